"""Motion over the open shutter: shutter times, animated attributes, choice of sample times, moving instances."""
