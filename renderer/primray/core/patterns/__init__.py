"""Patterns of a description to the core's tapes (renderer/core/pattern).

program.py holds what is computed, without repetition; nodes.py finds what a node computes in the files named after families of
nodes; compiling.py goes through a graph; registers.py gives values their registers.
"""
