"""Compiler of shading graphs (patterns) to the core's tapes, straight-line programs of a virtual machine
(renderer/core/pattern).

program.py holds operations, each computed once; tape_upload.py walks a graph, calls node_functions/, allocates registers and
writes the core's code.
"""
