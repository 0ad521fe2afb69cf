"""Other renderers beside ours: the same scenes for all of them, a runner for each, and which of them are installed.

`scenes.py` describes, `write_usd.py` and `write_plain.py` write, `run_*.py` are executed by the Python that has the renderer
(they import nothing but `loop.py` and `plain.py` of this project), `installed.py` finds them.
"""
