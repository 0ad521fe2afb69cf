"""Edits of a stage that vary from picture to picture: values of attributes, variants, and placements of prims.

varied_stage.py      what is written to the session layer of a stage, and what of it is read: placements, boxes, surfaces
values.py            values of a config as values of an attribute's type
larger_light.py      a light with larger sizes and the same power, for a while
rougher_material.py  a material with rougher lobes, for a while
"""
