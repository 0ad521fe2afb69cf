"""Code that all routes share: guards, reading of requests, making of answers.

guard.py      middleware around every request: ids, hosts, origins, headers, failures
callers.py    callers as dependencies: Reader, Submitter, Admin; request rates; measured.py: metrics
bodies.py     JSON bodies, read within limits and validated strictly; uploads.py: scenes
answers.py    JSON, ETags, conditional requests, problem documents; failures.py: exceptions as such
file_answer.py   files and ranges of them; retry_after.py: when to ask again
described.py  the OpenAPI description of operations; openapi.py makes the document
"""
