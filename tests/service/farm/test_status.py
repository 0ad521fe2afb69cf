"""How a cluster is shown."""

from __future__ import annotations

from primray_service.farm.status import FarmStatus, status_lines

NODES = [
    {"id": "aaaaaaaaaaaa", "host": "one", "slots": 2, "why": "", "sandbox": {}, "received": {"objects": 1, "bytes": 9}},
    {"id": "bbbbbbbbbbbb", "host": "two", "slots": 0, "why": "it has primray 0.1", "sandbox": {}, "received": {}},
]


def chunk(name: str, node: str) -> dict[str, object]:
    return {"name": name, "kind": "render", "node": node, "since": 100.0}


def test_nodes_and_what_runs_there() -> None:
    owners = [{"owner": "desk-7", "chunks": [chunk("shot.usda 0:64", "aaaaaaaaaaaa"), chunk("s.usda 8:16", "cccccccccccc")]}]
    assert status_lines(FarmStatus(NODES, owners), 112.0) == [
        "NODE      HOST  SLOTS  RUNNING",
        "aaaaaaaa  one   2      1",
        "                                render shot.usda 0:64, 12 s, for desk-7",
        "bbbbbbbb  two   0      0        it has primray 0.1",
        "cccccccc               1        not among the selected nodes",
        "                                render s.usda 8:16, 12 s, for desk-7",
    ]


def test_an_empty_cluster() -> None:
    assert status_lines(FarmStatus([], []), 0.0) == ["NODE  HOST  SLOTS  RUNNING"]
