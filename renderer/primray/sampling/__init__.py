"""Which samples come next, what the error is by now, when to stop, and what is left to do."""
