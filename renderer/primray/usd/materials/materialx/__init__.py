"""MaterialX documents as USD layers, and the standard library's node definitions.

The MaterialX package is imported only when a stage uses it. Documents: documents.py reads them; references.py redirects a
stage's references to layers that node_graphs.py, materials.py and looks.py write, with the layout of USD's plugin usdMtlx.
Nodes: definitions.py has the library's, which expressions.py expands to patterns, with constants folded by
constant_folding.py.
"""
