"""Instances of prototypes: their placements, and the state that prototypes inherit."""
