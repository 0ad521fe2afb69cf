"""What the server says of itself to its operator: logs, metrics, traces."""
