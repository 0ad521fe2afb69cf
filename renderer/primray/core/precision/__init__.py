"""Geometry that single precision cannot hold, made in double precision before it is uploaded to the core."""
