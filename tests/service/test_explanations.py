"""Explained pixels: a worker's messages are not believed, and no tenant keeps the others waiting."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from primray_service.config import ServeConfig
from primray_service.dispatcher.chunks.messages import NotBelieved
from primray_service.explanations import MOST_OF_TENANT, Explanations, report_of
from primray_service.files import DataDirectory
from primray_service.problems import Problem

BLACK = [0.0, 0.0, 0.0]
PART = {"name": "/sun", "value": BLACK, "error": None, "ci95": None, "share": 0.0, "share_error": None, "rare": False}
SPLITS = ("light", "kind", "bounce", "prim")
REPORT: dict[str, Any] = {
    "type": "explained-pixel",
    "pixel": [3, 4],
    "camera": "/camera",
    "value": BLACK,
    "error": None,
    "alpha": 1.0,
    "samples": 8,
    "renders": 15,
    "shown": None,
    "splits": {name: [PART] for name in SPLITS},
    "more": dict.fromkeys(SPLITS, 0),
    "noise": [],
}


def test_a_report_is_believed_if_it_has_the_answers_shape() -> None:
    assert report_of({"at": "done", "report": REPORT}) == REPORT
    with pytest.raises(ValidationError):
        report_of({"at": "done", "report": REPORT | {"splits": {"light": "<script>"}}})
    with pytest.raises(NotBelieved):
        report_of({"at": "done", "report": REPORT | {"noise": [[0] * 60_000]}})


def test_a_failure_says_nothing_beside_what_problems_say() -> None:
    sent = {
        "type": "/problems/scene-rejected",
        "title": "t",
        "status": 200,
        "detail": "No.",
        "headers": {"a": "b"},
        "prim": "/p",
    }
    with pytest.raises(Problem) as raised:
        report_of({"at": "failed", "problem": sent})
    found = raised.value
    assert (found.slug, found.status, found.headers, found.extra) == ("scene-rejected", 422, {}, {"prim": "/p"})


def test_a_tenant_waits_in_few_places(tmp_path: Path) -> None:
    async def work() -> None:
        store: Any = None
        explanations = Explanations(ServeConfig(data=tmp_path), DataDirectory(tmp_path), store)

        async def wait() -> None:
            async with explanations.turn("a"):
                pass

        async with explanations.turn("a"):
            waiting = [asyncio.create_task(wait()) for _ in range(MOST_OF_TENANT - 1)]
            await asyncio.sleep(0)
            with pytest.raises(Problem) as raised:
                await wait()
            assert (raised.value.slug, raised.value.headers) == ("unavailable", {"retry-after": "5"})
            other = asyncio.create_task(explanations.turn("b").__aenter__())
            await asyncio.sleep(0)
            assert not other.done(), "it waits for its turn"
            other.cancel()
        await asyncio.gather(*waiting)
        await wait()

    asyncio.run(work())
