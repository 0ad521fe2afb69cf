"""Sparse voxel grids: OpenVDB files read to arrays in numpy, without the OpenVDB library; independent of USD and of the core.

volume_grid      a grid as leaves, tiles and a background value, with trilinear lookups
vdb_file         a file's grids: what it has, and the values of one of them
vdb_transform    index space to the grid's own space
vdb_tree         nodes of a tree, its tiles and leaves
vdb_values       the values of one node, compressed in one of several ways
vdb_bytes        bounded reading of bytes, and the errors of all of these
"""
