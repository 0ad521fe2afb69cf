"""The render service: renders USD stages over HTTP, to a stated error.

    app.py, routes/     HTTP: parse, call one function, answer; http/: code that routes share
    api/                requests and answers as models, and the API's reference page
    auth.py, quotas.py  who calls: keys, sessions; what each tenant may use
    jobs.py             jobs, their states and moves (pure); admission.py: from a request to a job
    problems.py         every error answer
    limits.py           limits of uploads, jobs, workers and tenants
    store/              the only SQL: SQLite or PostgreSQL
    files.py            the data directory; objects.py: an object store that servers share instead
    shared_roots.py     shared storage whose stages jobs may name
    changes.py          notification of changes to jobs, and reads of them that are shared
    service.py          the parts of a running server, and the capabilities of the one that dispatches
    scenes/             uploads: streamed, recognised, unpacked, safely
    queue/              order of queued jobs, their positions and estimated starts
    dispatcher/         holds the lease, gives frames to an executor, adopts the results
    executor/           where chunks run: base.py is the interface
    farm/               a Ray cluster without the service: parts of frames, and its state
    worker/             the program that runs one chunk
    sandbox/            isolation of that program
    pictures/           previews, tone-mapped and encoded
    explanations.py     pixels of a job's picture, whose light is told apart on request
    webhooks/           calls of clients' addresses
    monitoring.py       logs, metrics, traces
    page/               the web page; main.js describes its folders
    live/               `primray view`: a page that shows a stage, without the service
    agents/             `primray mcp`: tools by which agents look at stages, without the service
    cli/, client/       `primray serve`, `submit`, ...; the Python client

Five words for the work of a job:

    frame    one picture of a job, at one time code; a job has one or many
    part     a range of a frame's samples, rendered at the same time as its other parts
    chunk    one command to one worker process: render a frame or a part up to its end, merge parts, check a scene, ...
    slot     room for one running chunk, on this machine or on a node of a cluster
    claim    the dispatcher's assignment of a queued frame or part to a chunk, under the fence of its lease

The server process never parses USD and never decodes an uploaded image: workers do, one process for each chunk.
"""
