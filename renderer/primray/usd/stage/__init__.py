"""The stage as USD composes it: opening, layers, guarded reads of values, traversal, edits of copies."""
