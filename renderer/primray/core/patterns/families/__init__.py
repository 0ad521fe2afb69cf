"""What nodes compute, in a file a family: functions from a Node to its outputs, and NODES, their names as MaterialX has them."""
