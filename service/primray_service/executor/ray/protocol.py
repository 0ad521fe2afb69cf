"""What a server and its Ray driver say to each other: one JSON object a line, as with workers (worker/protocol.py).

Server to driver, the first line being its settings
    {"do": "connect", "address": "auto" | "host:port", "cores": 8 | null, "slots": 4 | null, "labels": {"pool": "render"},
     "limits": {..}, "isa": "v3" | null, "allow_unsandboxed": false}
    {"do": "run", "id": "c01..", "chunk": {"name", "kind", "command", "inputs": {name: path}, "folders": {name: path},
     "load_cpu_s", "memory_bytes", "group", "more_follow", "scene", "keep_s"}, "folder": "/.../slots/x-1"}
        paths are of the server's machine, which the driver is on as well; the worker's files come to folder/out
    {"do": "tell", "id": "c01..", "command": {..}}     a later line for its worker
    {"do": "kill", "id": "c01.."}
    {"do": "look", "id": "1"}                           what runs on the cluster?

Driver to server
    failed    {"code", "why"}: it could not connect, and ends
    cluster   {"slots", "cores" (of a chunk), "memory_bytes" (of a chunk), "nodes": [{"id", "host", "slots", "why" ("" where it
              takes work), "sandbox": {..}, "received": {"objects", "bytes"}}]}: the first one says that it is connected
    message   {"id", "message": {..}}: a worker's, whose files are in the folder by now
    ended     {"id", "reason", "exit_code", "signal", "cpu_s", "peak_rss_bytes", "log", "log_file": true, "protocol_error"}:
              base.Ended; the log is folder/log.txt
    running   {"id", "owners": [{"owner", "chunks": [{"name", "kind", "node", "since" (Unix time)}]}]}: of all other drivers
"""

from __future__ import annotations

# A worker's line, in another one.
MAX_LINE_BYTES = 8 * 2**20

# Why a cluster cannot be worked with, as `failed` says; each is documented in docs/service/scaling.md.
NOT_INSTALLED, UNREACHABLE, WRONG_TOKEN, ADDRESS, NO_NODE = (
    "ray-missing",
    "ray-unreachable",
    "ray-token",
    "ray-address",
    "ray-no-node",
)
