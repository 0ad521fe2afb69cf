"""MaterialX documents as USD layers, and the standard library's node definitions.

The MaterialX package is imported only when a stage uses it.

documents.py: bytes to a document, bounded. layer_of.py: a document to a layer with the layout of USD's plugin usdMtlx
(materials.py, node_graphs.py, units.py). look/: a document's looks, that is assignments, variants and visibility.
redirecting.py: a stage's references to documents, redirected to such layers.
"""
