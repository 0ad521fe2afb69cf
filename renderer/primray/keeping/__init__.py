"""Scenes that stay from one render to the next: `scene` for callers, `kept_steps` what is kept of each step of preparing."""
