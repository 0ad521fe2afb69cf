"""Light path expressions: their grammar, and the automaton that the core follows paths by. docs/light-paths.md describes them.

`grammar` reads one, `events` are what it is of, `automaton` makes several of them into `tables` of states.
"""
