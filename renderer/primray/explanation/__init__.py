"""One pixel explained: whose light it is made of, which paths make its noise, and what would lessen that.

`pixel` renders the samples of a pixel again, with the core's log; `parts` splits them so that parts add up to the pixel to the
bit; `explained` is the library call, with its text and JSON.
"""
