"""Compiler of shading graphs (patterns) to the core's tapes, straight-line programs of a virtual machine
(renderer/core/pattern).

program.py holds operations, each computed once; nodes.py finds the function of a node in the files named after families of
nodes; compiling.py walks a graph; registers.py allocates registers.
"""
