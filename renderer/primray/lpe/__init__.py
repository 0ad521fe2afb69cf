"""Light path expressions: their grammar, and the automaton by which the core classifies paths (docs/light-paths.md)."""
