"""Traversal of the stage into groups of leaves, and placement of groups."""
