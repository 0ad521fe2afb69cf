"""Materials: shading networks evaluated to surfaces, their textures, and the binding of materials to shapes.

material.py translates a UsdShadeMaterial; appearance.py chooses the surface of a shape; bound_materials.py resolves bindings.
Networks, one way: authored.py reads what is authored in the network of a material, each attribute once; network.py follows
connections to constants and nodes; node_values.py evaluates nodes, with usd_nodes.py and texture_files.py; surface_inputs.py
reduces the results to inputs of a Surface.

Surface models are in models/ (MaterialX's), mdl/ (Omniverse's) and other_renderers/ (Arnold's, RenderMan's, Houdini's);
materialx/ reads documents and the node library.
"""
