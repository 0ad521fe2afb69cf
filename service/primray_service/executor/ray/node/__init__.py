"""What runs on a node of the cluster, in Ray's processes there; a chunk itself runs in the sandboxed worker that they start.

tasks.py        all that Ray is asked to run
fitness.py      whether this node takes work: its versions, its CPU class, its token, its walls
chunk_task.py   a chunk: its files come, its worker runs, its messages and files go
order.py, items.py, content.py    what goes to a node and what comes back
mailbox.py      what is said to a chunk that runs
cache.py        contents that this node has already
runner.py       a LocalExecutor in a thread of its own; leaving.py: files on their way back
"""
