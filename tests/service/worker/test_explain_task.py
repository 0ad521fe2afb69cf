"""Of a pixel with many parts the largest are sent, with the number of the others."""

from __future__ import annotations

from typing import Any

from primray_service.worker.explain_task import MOST_PARTS, said_of


class Explained:
    def as_json(self) -> dict[str, Any]:
        return {"splits": {"light": [{"name": "sun"}], "prim": [{"name": str(k)} for k in range(MOST_PARTS + 3)]}}


def test_the_largest_parts_are_sent() -> None:
    explained: Any = Explained()
    said = said_of(explained)
    assert said["more"] == {"light": 0, "prim": 3}
    assert [part["name"] for part in said["splits"]["prim"]] == [str(k) for k in range(MOST_PARTS)]
