"""Materials of MDL's stock modules, those of Omniverse and Isaac: their documented inputs in the record of known surfaces.

by_name.py has the list of modules, inputs.py what they are read with. Nothing of MDL itself is interpreted.
"""
