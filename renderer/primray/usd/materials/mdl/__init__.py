"""Materials of the stock MDL modules of Omniverse and Isaac: their documented inputs read into a KnownSurface.

by_name.py lists the modules, inputs.py reads inputs. MDL code itself is not interpreted.
"""
