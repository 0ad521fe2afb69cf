"""What is asked of a composed stage in one way only: which prims are seen, and what changes over time."""
