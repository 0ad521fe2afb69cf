"""What nodes compute, in a file a family: functions from a Node to its outputs, and NODES, their names in MaterialX."""
