"""Sampling: which samples come next, the error so far, when to stop, and how much remains."""
