"""MaterialX documents as USD layers, and the standard library of nodes. The package MaterialX is imported where it is needed:
only by stages that have any of it.

documents.py       bytes to a document, bounded
layer_of.py        a document to a layer, as USD's own plugin usdMtlx lays it out: materials.py, node_graphs.py, units.py
look/              a document's looks: assignments, variants, visibility
redirecting.py     a stage's layers with their references to documents led to such layers
"""
