"""Node functions by family, from a Node to its outputs; NODES maps MaterialX's names to them."""
