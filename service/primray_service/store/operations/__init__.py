"""Operations of the store, a file for each kind of row; sql_store.py combines them."""
