"""Volume prims (UsdVol): grids of voxels from OpenVDB files, and volume shaders, to media and emission of the description.

volume           a Volume prim: its fields, its material and its placements
fields           field prims: which file and grid each names, and where it is
files            grids of OpenVDB files, with values that can be rendered
coefficients     what a volume shader says: absorption, scattering and emission, as operands of a pattern
shaders          volume shaders of MaterialX and Karma, and Storm's fallback
other_renderers  volume shaders of Arnold and RenderMan
volume_light     emission of a Volume with VolumeLightAPI
in_shapes        volume shaders in closed shapes, which they fill with a medium of constant coefficients
node_arrays      a pattern's nodes evaluated on arrays of voxels
linear_forms     operands that are sums of fields times constants, which need no evaluation
baking           coefficients that vary otherwise, evaluated at the voxels of new grids
"""
