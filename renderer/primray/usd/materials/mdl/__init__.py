"""Materials of the stock MDL modules of Omniverse and Isaac: their documented inputs read into a KnownSurface.

modules.py has the table of modules, inputs.py reads inputs. MDL code itself is not interpreted.
"""
