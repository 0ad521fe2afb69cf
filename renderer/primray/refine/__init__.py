"""Preparation of a description for the core: dicing, and geometry that single precision cannot hold made in double
precision."""
