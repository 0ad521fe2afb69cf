"""Telemetry for the server's operator: logs, metrics, traces."""
