"""Light path expressions: their grammar, and the automaton by which the core classifies paths (docs/light-paths.md).

`grammar` parses an expression, `events` defines its letters, `automaton` makes one automaton of several expressions, and
`tables` its arrays for the core.
"""
