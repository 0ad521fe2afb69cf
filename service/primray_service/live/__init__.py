"""`primray view`: a page on this machine that shows one stage, of the user's own, as it is looked at (primray/live).

    command.py    its flags
    server.py     the running server; one process, on loopback
    app.py        what it answers: the page, events, pictures, commands
    page/         the page itself; it shares base/ and style/ of the service's

Nothing of the job service runs: no store, no jobs, no sandbox. Whoever knows the address, which has a secret in it, may look.
"""
