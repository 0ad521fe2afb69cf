"""The stage's range without its composition, beside Usd.Stage's own answer."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from pxr import Sdf, Usd

from primray.cli import run
from primray.errors import SettingsError, StageOpenError
from primray.usd.stage.open import time_range


def layer(path: Path, ends: tuple[float | None, float | None], *sublayers: Path) -> str:
    made = Sdf.Layer.CreateNew(str(path))
    made.subLayerPaths = [str(name) for name in sublayers]
    if ends[0] is not None:
        made.startTimeCode = ends[0]
    if ends[1] is not None:
        made.endTimeCode = ends[1]
    made.Save()
    return str(path)


ENDS = [(None, None), (1.0, 10.0), (None, 20.5), (0.0, None)]


@pytest.mark.parametrize(("of_root", "of_session"), list(product(ENDS, [None, *ENDS])))
def test_the_range_is_the_stages(
    of_root: tuple[float | None, float | None], of_session: tuple[float | None, float | None] | None, tmp_path: Path
) -> None:
    layer(tmp_path / "below.usda", (5.0, 6.0))
    root = layer(tmp_path / "root.usda", of_root, tmp_path / "below.usda")
    session = None if of_session is None else layer(tmp_path / "session.usda", of_session, tmp_path / "below.usda")
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(root), Sdf.Layer.FindOrOpen(session) if session else None)
    if all(stage.HasAuthoredMetadata(key) for key in ("startTimeCode", "endTimeCode")):
        assert time_range(root, session) == (stage.GetStartTimeCode(), stage.GetEndTimeCode())
    else:
        with pytest.raises(SettingsError, match=r"TimeCode.*write the numbers"):
            time_range(root, session)


def test_a_stage_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StageOpenError):
        time_range(str(tmp_path / "none.usda"), None)


def test_frames_by_name_are_rendered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    layer(Path("shot.usda"), (7.0, 9.0))
    assert run(["render", "shot.usda", "--frames", "start:endx2", "--res", "4", "4", "--spp", "1", "-o", "shot.####.exr"]) == 0
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == ["shot.0007.exr", "shot.0009.exr"]
