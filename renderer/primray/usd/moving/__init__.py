"""Motion over the open shutter in numpy: transforms at any time, and the times at which to sample them. Independent of USD."""
