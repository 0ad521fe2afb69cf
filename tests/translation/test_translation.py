"""What stages translate to, as text. PRIMRAY_UPDATE=1 writes the expected files anew: read the difference before committing."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from primray.diagnostic_codes import Severity
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, translate

from .describe import describe

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
CASES = {path.stem: path for path in sorted(HERE.glob("cases/*.usda"))}
CASES |= {path.parent.name: path for path in sorted(ROOT.glob("scenes/features/*/scene.usda"))}
CASES |= {path.stem: path for path in sorted(ROOT.glob("scenes/analytic/*.usda"))}

# What moves has to be seen at a frame.
MOVING = {name: 1.0 for name in CASES if name.startswith(("motion-", "rolling-", "moving_", "turning_"))}


def expected_file(path: Path) -> Path:
    """Beside a case of this folder; for the project's scenes in `scenes/`."""
    if HERE in path.parents:
        return path.with_suffix(".expected.json")
    return HERE / "scenes" / f"{path.parent.name if path.stem == 'scene' else path.stem}.expected.json"


@pytest.mark.parametrize("name", CASES)
def test_case(name: str) -> None:
    path = CASES[name]
    opening = Diagnostics()
    description, diagnostics = translate(open_stage(path, opening), RenderSettings(time_code=MOVING.get(name)))
    text = describe(description, [*opening, *diagnostics], str(path.parent))
    text = text.replace(json.dumps(str(path.parent.parent))[1:-1], "<root>/..")  # what it shares with others
    expected = expected_file(path)
    if os.environ.get("PRIMRAY_UPDATE"):
        expected.parent.mkdir(exist_ok=True)
        expected.write_text(text)
    assert text == expected.read_text()


OWN = sorted(ROOT.glob("scenes/**/*.usda"))


@pytest.mark.parametrize("path", OWN, ids=lambda p: str(p.relative_to(ROOT / "scenes")))
def test_own_scenes_ask_for_nothing_unsupported(path: Path) -> None:
    opening = Diagnostics()
    stage = open_stage(path, opening)
    frame = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    _, diagnostics = translate(stage, RenderSettings(time_code=frame))
    bad = {d.code for d in (*opening, *diagnostics) if d.severity is not Severity.INFO}
    assert bad == set()
