"""Pictures of a running job: the worker's preview, tone-mapped and encoded for a browser.

request.py     parameters of a picture
views.py       a preview's values as 8-bit pixels (numpy, OpenColorIO), and as PNG; the display transform as a table
process.py     the helper process in which this happens, so that the server's event loop never waits for it
encoder.py     the server's interface to it, with a cache of recent pictures
"""
