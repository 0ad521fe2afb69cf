"""What a prim is before an adapter sees it: its kind, what it inherits, its values read and checked."""
