"""Queries of a composed stage that shall be answered in one way only: which prims are visited, and what varies over time."""
