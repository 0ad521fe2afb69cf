"""What all routes share: how requests are guarded and read, and how answers are made.

guard.py      what surrounds every request: ids, hosts, origins, headers, what goes wrong
callers.py    who asks, as dependencies: Reader, Submitter, Admin; rates.py: how often; measured.py: counted and timed
bodies.py     JSON bodies, read within limits and checked strictly; uploads.py: scenes
answers.py    JSON, ETags, conditional requests, problem documents; failures.py: exceptions as such
file_answer.py, byte_ranges.py   files and parts of them; retry_after.py: when to ask again
described.py  what the OpenAPI document says of operations; openapi.py makes it
"""
