"""`primray mcp`: agents look at stages through the Model Context Protocol, over stdio or HTTP.

    command.py          the command
    server.py           the tools, their arguments and answers; the only file that knows the protocol's SDK
    scene_processes.py  a process for each scene: started in the sandbox, limited, ended when others need its memory
    scene_process.py    that process: keeps one stage open and answers requests
    looks.py            views of a kept stage, what is seen in them, what an edit changed; bounded pictures

The server never parses USD; a stage that ends its process costs one answer.
"""
