"""The report of a render, and the statistics of a scene."""
