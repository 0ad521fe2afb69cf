"""State of a prim before an adapter sees it: its kind, what it inherits, its values read and checked."""
