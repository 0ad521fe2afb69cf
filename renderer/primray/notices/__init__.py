"""What primray says to whoever calls it: diagnostics in words, as Python warnings and log records, and what notebooks show."""
