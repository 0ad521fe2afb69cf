"""Frames that wait: their turns, their places, claims of them, and how long their work takes."""
