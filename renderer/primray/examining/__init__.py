"""Reasons why a stage comes out slow, grey, dark or empty, found from a few seconds of rendering."""
