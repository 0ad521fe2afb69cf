"""Lights beyond their own prim: colours, illuminants, links, portals, IES files, photometric amounts, default lights."""
