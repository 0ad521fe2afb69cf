"""Materials that carry only Arnold's, RenderMan's or Houdini's shaders, translated by those renderers' public documentation.

material.py chooses the vocabulary and reports what was translated; values.py evaluates networks; each vocabulary has its
surfaces and its nodes in files of its own. A node's rule builds MaterialX nodes, so that textures, primvars, spaces and
wrapping follow the code that is there for them.
"""
