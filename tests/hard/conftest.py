"""What hard cases share: each test declares its case with the marker `hard_case` and states what it measured.

    @pytest.mark.hard_case("Far worlds", "moved by 1e8 units", expected="the picture at 0, edges to 0.01 px",
                           plain_float="edges 4 px off")
    def test_...(measured): ...; measured(f"{shift:.4f} px")

With PRIMRAY_UPDATE=1 the statements are kept in tests/hard/measured/<module>.json, from which `make docs` makes
docs/hard-cases.md. Of a parametrised test, every case is a row; `%s` in the texts takes the parameters' ids.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

MEASURED = Path(__file__).parent / "measured"


@pytest.fixture
def measured(request: pytest.FixtureRequest) -> Iterator[Callable[[str], None]]:
    """Takes, once, the sentence that says what this case's test found."""
    said: list[str] = []
    yield said.append
    assert len(said) <= 1, "a case states what it measured once"
    if said and os.environ.get("PRIMRAY_UPDATE"):
        _keep(request.node, said[0])


def _keep(test: pytest.Item, sentence: str) -> None:
    marker = test.get_closest_marker("hard_case")
    assert marker is not None, f"{test.nodeid} declares no hard_case"
    family, case = marker.args
    ids = test.callspec.id if hasattr(test, "callspec") else ""
    row = {"family": family, "case": case, "measured": sentence, **marker.kwargs}
    row = {name: text.replace("%s", ids) for name, text in row.items()}
    file = MEASURED / f"{Path(test.path).stem}.json"
    rows = json.loads(file.read_text()) if file.exists() else {}
    rows[test.nodeid.rpartition("::")[2]] = row
    MEASURED.mkdir(exist_ok=True)
    file.write_text(json.dumps(dict(sorted(rows.items())), indent=2, ensure_ascii=False) + "\n")
