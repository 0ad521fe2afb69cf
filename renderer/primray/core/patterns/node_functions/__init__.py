"""Functions that compile nodes, from a Node to its outputs, with tables of them by MaterialX's names."""
