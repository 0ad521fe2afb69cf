"""What a command writes to its standard streams while it works, and what becomes of streams that cannot take it."""
