"""Incremental rendering: scenes that stay in memory between renders. `scene` is for callers, `steps` caches each step."""
