"""Incremental rendering: scenes that stay in memory between renders. `scene` is for callers, `kept_steps` caches each step."""
