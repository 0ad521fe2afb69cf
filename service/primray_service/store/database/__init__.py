"""The database below the operations: its tables, its connections, and what one transaction is."""
