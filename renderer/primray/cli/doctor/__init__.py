"""Text output of `primray doctor`."""
