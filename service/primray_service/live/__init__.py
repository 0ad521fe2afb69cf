"""`primray view`: a local web page that shows one of the user's own stages and follows its changes (primray/live).

    command.py    its flags
    server.py     the running server; one process, on loopback
    app.py        the application: the page, events, pictures, commands
    page/         the page; it shares the service's files, and primray/live/page with notebooks and the service

The job service is not involved: no store, no jobs, no sandbox. Access needs the address, which contains a secret.
"""
