"""The database layer below the operations: tables, connections and transactions."""
