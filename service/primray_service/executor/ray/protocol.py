"""Protocol between a server and its Ray driver: one JSON object a line, as with workers (worker/protocol.py).

Server to driver, the first line being its settings
    {"do": "connect", "address": "auto" | "host:port", "cores": 8 | null, "slots": 4 | null, "labels": {"pool": "render"},
     "limits": {..}, "isa": "v3" | null, "allow_unsandboxed": false}
    {"do": "run", "id": "c01..", "chunk": {"name", "kind", "command", "inputs": {name: path}, "folders": {name: path},
     "load_cpu_s", "memory_bytes", "group", "more_follow", "scene", "keep_s"}, "folder": "/.../slots/x-1"}
        paths are on the server's machine, where the driver runs as well; the worker's files arrive in folder/out
    {"do": "tell", "id": "c01..", "command": {..}}     a command for its worker
    {"do": "kill", "id": "c01.."}
    {"do": "exclude", "id": "", "node": "..", "why": ".."}   a node that takes no more work, whatever it says of itself
    {"do": "look", "id": "1"}                           asks what runs on the cluster

Driver to server
    failed    {"code", "why"}: it could not connect, and exits
    cluster   {"slots", "cores" (of a chunk), "memory_bytes" (of a chunk), "nodes": [{"id", "host", "slots", "why" ("" if it
              takes work), "sandbox": {..}, "received": {"objects", "bytes"}}]}: the first one means that it is connected
    began     {"id", "node"}: the node that runs the chunk
    message   {"id", "message": {..}}: a worker's message, whose files are already in the folder
    ended     {"id", "reason", "exit_code", "signal", "cpu_s", "peak_rss_bytes", "log", "log_file": true, "protocol_error"}:
              base.Ended; the log is folder/log.txt
    running   {"id", "owners": [{"owner", "chunks": [{"name", "kind", "node", "since" (Unix time)}]}]}: of all other drivers
"""

from __future__ import annotations

# A worker's line, embedded in another one.
MAX_LINE_BYTES = 8 * 2**20

# Codes of `failed`, for why a cluster cannot be used; each is documented in docs/service/scaling.md.
NOT_INSTALLED, UNREACHABLE, WRONG_TOKEN, ADDRESS, NO_NODE = (
    "ray-missing",
    "ray-unreachable",
    "ray-token",
    "ray-address",
    "ray-no-node",
)
