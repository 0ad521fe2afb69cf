"""What becomes of a description before the core sees it: cages diced, geometry that floats cannot hold made in double."""
