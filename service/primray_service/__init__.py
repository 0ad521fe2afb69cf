"""The render service: USD in over HTTP, images and their error out.

    app.py, routes/     HTTP: parse, call one function, answer; http/: what routes share
    api/                what clients send and get
    access/             who may ask, and for how much
    jobs.py             what a job is (pure); admission.py: from a request to a job
    problems.py         everything that is answered as an error
    limits.py           what is allowed
    store/              the only SQL: SQLite or PostgreSQL
    files.py            the data directory; objects.py: an object store that servers share in its place
    shared_roots.py     shared storage whose stages jobs may name
    leading.py          what the server that dispatches can do, for answers that are the same on all servers
    held.py             what is locked by whoever uses it, made while others sweep
    scenes/             uploads: streamed, recognised, unpacked, safely
    dispatcher/         holds the lease, gives frames to an executor, adopts what comes back
    executor/           where chunks run: base.py is the interface
    farm/               a cluster without the service: parts of frames, and what it does
    worker/             the program that runs one
    sandbox/            the walls around it
    telemetry/          logs, metrics, traces
    page/               the web page; main.js says how it is arranged
    live/             `primray view`: a page that shows a stage, without the service
    cli/, client/       `primray serve`, `submit`, ...; the Python client

The server process never parses USD and never decodes an image that somebody sent: workers do, one process a chunk.
"""
