"""Primvars: reading and validation, those that surfaces read, and those that vary over instances."""
