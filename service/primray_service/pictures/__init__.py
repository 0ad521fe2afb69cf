"""Pictures of a job as it goes on: the preview that its worker wrote, tone-mapped and encoded for a browser.

request.py     which picture is asked for
views.py       the numbers of a preview as 8-bit values (numpy, OpenColorIO)
view_table.py  the view that they are seen through, for a page that draws by itself
png.py         those as PNG
process.py     the process in which that happens, so that the server's event loop never waits for it
encoder.py     the server's end of it, and what it has made lately
"""
