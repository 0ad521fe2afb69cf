"""Checkpoints: a render in progress saved to a file, resumed from it, and merged with others of the same picture."""
