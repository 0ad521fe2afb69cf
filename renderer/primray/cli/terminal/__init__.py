"""Output to the terminal: progress, errors, and standard streams that survive failures."""
