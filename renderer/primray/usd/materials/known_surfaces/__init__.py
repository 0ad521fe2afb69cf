"""Surface nodes that are known by name: what they say, in the words of one record (record.py), a file a model.

by_name.py has the list; as_open_pbr.py makes of a record what can be rendered, and of it alone knows what has no effect.
"""
