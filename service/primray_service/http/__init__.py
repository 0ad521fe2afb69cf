"""Code that all routes share: guards, reading of requests, making of answers.

guard.py      middleware around every request: ids, hosts, origins, headers, failures, metrics
routing.py    routes, declared with what they take and answer; parameters.py: their handlers' parameters
callers.py    callers as parameters: Reader, Submitter, Admin; request rates; the log of what administrators do
bodies.py     JSON bodies, read within limits and validated strictly; uploads.py: scenes
answers.py    JSON, ETags, conditional requests, problem documents
file_answer.py   files and ranges of them; retry_after.py: when to ask again
described.py  the description of answers and bodies; openapi.py makes the document of all routes
"""
