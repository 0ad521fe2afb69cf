"""What nodes compute, a file a family: functions from a Node to its outputs, and NODES, by their names in MaterialX."""
