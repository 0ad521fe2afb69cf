"""Compiler of shading graphs (patterns) to the core's tapes, straight-line programs of a virtual machine
(renderer/core/pattern).

program.py holds operations, each computed once; compiler.py walks a graph and calls node_functions/; tape_upload.py
allocates registers and writes the core's code.
"""
