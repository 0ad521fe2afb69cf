"""The report of a render, and what a scene counts."""
