"""Pictures of a running job: the worker's preview, tone-mapped and encoded for a browser.

request.py     parameters of a picture
process.py     the helper process, so that the server's event loop never waits: a preview's values as 8-bit pixels (numpy,
               OpenColorIO), as PNG or JPEG; the display transform as a table
encoder.py     the server's interface to it, with a cache of recent pictures
"""
