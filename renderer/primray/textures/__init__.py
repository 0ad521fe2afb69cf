"""Image files read to texels in the rendering space, and photometric files to profiles; independent of USD and of the core."""
