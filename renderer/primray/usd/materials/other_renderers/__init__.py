"""Materials with only Arnold, RenderMan or Houdini shaders, translated by those renderers' public documentation.

translation.py chooses the renderer and reports what was translated; values.py evaluates networks; each renderer has its
surfaces and its nodes in files of its own. The rule of a node builds MaterialX nodes, so that textures, primvars, spaces and
wrapping are handled by the same code.
"""
