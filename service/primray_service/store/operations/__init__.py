"""What the service asks of its database, a file for each kind of row; sql_store.py is all of them."""
