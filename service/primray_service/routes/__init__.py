"""HTTP: one file for each resource, each with a `router`; app.py lists them.

    access.py      who asks, as dependencies: Reader, Submitter, Admin
    answers.py     JSON, ETags, conditional requests, problem documents
    bodies.py      JSON bodies, read within limits and checked strictly
    described.py   what the OpenAPI document says of operations
    guard.py       what surrounds every request: ids, hosts, origins, headers, what goes wrong

Routes parse, call one function, and answer. What takes the store's time runs in threads (`def` routes, or in_thread).
"""
