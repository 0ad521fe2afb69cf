"""Messages to the user: diagnostics as text, Python warnings and log records, and notebook output."""
