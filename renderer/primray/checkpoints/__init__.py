"""Checkpoints: a render under way as a file, gone on with, and merged with others of the same picture."""
