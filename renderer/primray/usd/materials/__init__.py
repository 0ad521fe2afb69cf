"""Materials: shading networks evaluated to surfaces, their textures, and the binding of materials to shapes.

material.py translates a UsdShadeMaterial; appearance.py chooses the surface of a shape; bound_materials.py resolves bindings.
Networks: network.py follows connections, node_values.py evaluates nodes, surface_inputs.py reduces the results to inputs of a
Surface. Surface models are in models/ (MaterialX's), mdl/ (Omniverse's) and other_renderers/ (Arnold's, RenderMan's,
Houdini's); materialx/ reads documents and the node library.
"""
