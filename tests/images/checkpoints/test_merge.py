"""Ranges of samples, rendered apart and merged, have the bits of one render; what cannot be merged is told."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray.checkpoints.checkpoint import load
from primray.checkpoints.checkpointing import Checkpointing
from primray.checkpoints.merge import merge
from primray.cli import run as primray_command
from primray.errors import CheckpointError
from primray.images.image import Image
from primray.settings import RenderSettings

from .resuming import assert_same, begin, cutter, go_on, run, save, sha256

__all__ = ["cutter"]  # a fixture

STAGE = Path(__file__).parents[3] / "scenes/features/implicit-shapes/scene.usda"


def parts_of(folder: Path, *bounds: int, **values: Any) -> list[Path]:
    """Checkpoints of the ranges between these."""
    ranges = pairwise(bounds)
    return [save(run(sample_range=(a, b), **values), folder / f"{a}-{b}.prc") for a, b in ranges]


def code_of(*paths: Path) -> tuple[str, str]:
    with pytest.raises(CheckpointError) as caught:
        merge(paths)
    assert caught.value.where
    return caught.value.code, str(caught.value)


@pytest.mark.parametrize("seed", range(4))
def test_any_partition_in_any_order(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    end = 2 * int(rng.integers(20, 50))
    cuts = sorted({2 * int(k) for k in rng.integers(1, end // 2, rng.integers(1, 6))})
    paths = parts_of(tmp_path, 0, *cuts, end, threads=1 + seed)
    rng.shuffle(paths)
    whole, merged = run(spp=end), merge(paths)
    assert merged.image.report["pixels_sha256"] == sha256(whole)
    np.testing.assert_array_equal(merged.image.errors, whole.film.image()[1])
    for name, array in whole.film.state().items():
        np.testing.assert_array_equal(merged.arrays[f"film.{name}"], array, name)
    assert merged.image.report["error"] == whole.rows[-1].error.as_json()
    assert merged.image.report["sample_ranges"] == [[0, end]]
    assert merged.image.report["samples_per_pixel"] == [end, end]
    assert merged.image.report["diagnostics"] == []


def test_merges_of_merges_and_of_plain_renders(tmp_path: Path) -> None:
    plain = save(run(spp=16), tmp_path / "plain.prc")
    tail = merge(parts_of(tmp_path, 16, 20, 50))
    tail.save_checkpoint(tmp_path / "tail.prc")
    merged = merge([tmp_path / "tail.prc", plain])
    assert merged.image.report["pixels_sha256"] == sha256(run(spp=50))


def test_a_part_is_resumed_with_its_range(tmp_path: Path, cutter: Any) -> None:
    part = begin(sample_range=(8, 40))
    for _ in range(50):
        part.run()
        assert part.stop is not None
        if part.stop.reason == "samples":
            break
        part = go_on(save(part, tmp_path / "part.prc"), sample_range=(8, 40))
    assert cutter.cuts > 0
    cutter.share = 0
    assert_same(run(sample_range=(8, 40)), part)
    # And is extended with another end.
    further = go_on(save(part, tmp_path / "part.prc"), sample_range=(8, 60))
    further.run()
    assert_same(run(sample_range=(8, 60)), further)


def test_a_merged_checkpoint_is_resumed(tmp_path: Path) -> None:
    path = tmp_path / "merged.prc"
    merge(parts_of(tmp_path, 0, 10, 34)).save_checkpoint(path)
    going_on = go_on(path, spp=70)
    going_on.run()
    assert sha256(going_on) == sha256(run(spp=70))
    for name, array in run(spp=70).film.state().items():
        np.testing.assert_array_equal(going_on.film.state()[name], array, name)


def test_gaps_are_told_and_can_be_filled(tmp_path: Path) -> None:
    a, b, c, d = parts_of(tmp_path, 0, 4, 10, 12, 20)
    holed = merge([d, b])
    codes = {row["code"]: row["message"] for row in holed.image.report["diagnostics"]}
    assert codes == {"samples-missing": "samples 0:4, 10:12 are in none of the parts"}
    assert holed.image.report["sample_ranges"] == [[4, 10], [12, 20]]
    assert holed.image.report["samples_per_pixel"] == [14, 14]
    assert holed.image.report["error"]["relmse"]["estimate"] > 0
    path = tmp_path / "holed.prc"
    holed.save_checkpoint(path)
    with pytest.raises(CheckpointError, match=r"samples 10:12 are missing from it; merge them first"):
        go_on(path, spp=40)
    filled = merge([path, a, c])
    assert filled.image.report["pixels_sha256"] == sha256(run(spp=20))
    assert filled.image.report["diagnostics"] == []


def test_a_tail_alone_is_a_picture_with_a_warning(tmp_path: Path) -> None:
    (tail,) = parts_of(tmp_path, 6, 12)
    merged = merge([tail])
    assert [row["message"] for row in merged.image.report["diagnostics"]] == ["samples 0:6 are in none of the parts"]
    assert merged.image.report["settings"]["sample_range"] == [6, 12]


def test_samples_in_two_parts(tmp_path: Path) -> None:
    a, b = *parts_of(tmp_path, 0, 8), *parts_of(tmp_path, 6, 12)
    code, message = code_of(a, b)
    assert code == "checkpoint-merge"
    assert "samples 6:8 are also in 0-8.prc" in message
    assert "samples 0:8 are also in" in code_of(a, a)[1]


def test_what_is_no_part(tmp_path: Path, cutter: Any) -> None:
    cutter.share = 0.0
    (a,) = parts_of(tmp_path, 0, 2)
    adaptive = save(run(spp=64, adaptive=True), tmp_path / "adaptive.prc")
    assert "its sampling is adaptive" in code_of(adaptive)[1]
    other = save(run(spp=4, seed=5), tmp_path / "other.prc")
    assert "seed is 5 in the checkpoint and 0 here" in code_of(a, other)[1]
    cutter.share = 1.0
    sampling = begin(sample_range=(2, 60))
    sampling.run()
    assert "resume it first" in code_of(a, save(sampling, tmp_path / "half.prc"))[1]
    assert code_of(tmp_path / "none.prc")[0] == "checkpoint-missing"
    a.write_bytes(a.read_bytes()[:-1])
    assert code_of(a)[0] == "checkpoint-damaged"


SMALL = ["--res", "40", "24"]


def render_range(folder: Path, text: str) -> Path:
    path = folder / f"{text.replace(':', '-')}.prc"
    flags = ["--sample-range", text, "--checkpoint", str(path), "-o", str(path.with_suffix(".exr"))]
    assert primray_command(["render", str(STAGE), *SMALL, *flags]) == 0
    return path


def test_the_whole_way(tmp_path: Path) -> None:
    """Ranges to a picture whose file says what that of one render says, and a checkpoint that goes on from there."""
    parts = [str(render_range(tmp_path, text)) for text in ("8:14", "0:8")]
    out, report, saved = tmp_path / "m.exr", tmp_path / "m.json", tmp_path / "m.prc"
    assert primray_command(["merge", *parts, "-o", str(out), "--report", str(report), "--checkpoint", str(saved)]) == 0
    direct = primray.render(STAGE, RenderSettings(resolution=(40, 24), spp=14))
    direct.save(tmp_path / "direct.exr")
    facts = json.loads(report.read_text())
    assert facts["pixels_sha256"] == direct.report["pixels_sha256"]
    for name in ("error", "scene", "features", "diagnostics", "samples", "rays_by_kind", "splits", "light_samples", "versions"):
        assert facts[name] == json.loads(json.dumps(direct.report[name])), name
    assert facts["parts"] == parts
    headers, own = [], ("primray:lane_occupancy", "oiio:SourcePath", "DateTime")
    for file in (out, tmp_path / "direct.exr"):
        spec = oiio.ImageBuf(str(file)).spec()
        headers.append({a.name: a.value for a in spec.extra_attribs if a.name not in own})
    assert headers[0] == headers[1]
    assert "worldtocamera" in {name.lower() for name in headers[0]}
    image = primray.render(STAGE, RenderSettings(resolution=(40, 24), spp=20), checkpointing=Checkpointing(saved, resume=saved))
    direct = primray.render(STAGE, RenderSettings(resolution=(40, 24), spp=20))
    assert image.report["pixels_sha256"] == direct.report["pixels_sha256"]
    assert load(saved).ranges == ((0, 20),)


def test_names_get_the_frame_that_the_parts_are_of(tmp_path: Path) -> None:
    parts = []
    for text in ("0:2", "2:4"):
        flags = ["--frames", "7", "--sample-range", text, "-o", str(tmp_path / "part.exr")]
        parts.append(str(tmp_path / f"{text.replace(':', '-')}.prc"))
        assert primray_command(["render", str(STAGE), *SMALL, *flags, "--checkpoint", parts[-1]]) == 0
    names = ("-o", "m.####.exr"), ("-o", "m.$F2.png"), ("--report", "m.%03d.json"), ("--checkpoint", "m.##.prc")
    asked = [word for flag, name in names for word in (flag, str(tmp_path / name))]
    assert primray_command(["merge", *parts, *asked]) == 0
    assert {path.name for path in tmp_path.glob("m.*")} == {"m.0007.exr", "m.07.png", "m.007.json", "m.07.prc"}
    assert primray_command(["merge", *parts, *asked]) == 2  # what would be overwritten is the checkpoint of that name


MOVING = """#usda 1.0
def Camera "eye"
{
    double shutter:close = 0.5
    float primray:lens:diffusion:strength = 0.25
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball"
{
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (2, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_what_moves_and_what_the_lens_does_are_in_merged_pictures_too(tmp_path: Path) -> None:
    stage = tmp_path / "moving.usda"
    stage.write_text(MOVING)

    def rendered(**values: Any) -> Image:
        chosen = RenderSettings(resolution=(40, 24), time_code=1.0, **values)
        saved = tmp_path / f"{chosen.sample_range}.prc"
        return primray.render(stage, chosen, checkpointing=Checkpointing(saved))

    direct = rendered(spp=8)
    spans = ((0, 4), (4, 8))
    for span in spans:
        rendered(sample_range=span)
    image = merge([tmp_path / f"{span}.prc" for span in spans]).image
    assert image.report["motion"] == direct.report["motion"]
    assert "moving" in direct.report["motion"]
    assert image.report["diffusion"] == direct.report["diffusion"]
    assert image.diffused is not None
    assert direct.diffused is not None
    np.testing.assert_array_equal(image.diffused.pixels, direct.diffused.pixels)


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (["-o", "o.exr", "--checkpoint", "o.txt"], "the checkpoint exists already"),
        (["-o", "o.exr", "--checkpoint", "part.prc"], "overwrite a file that the command reads"),
        (["-o", "o.exr", "--checkpoint", "no/such.prc"], "folder no does not exist"),
        (["-o", "no/o.exr"], "folder no does not exist"),
        (["-o", "o.txt"], "unknown-extension"),
        (["-o", "o.png", "--view", "none such"], "none such"),
        (["-o", "o.exr", "missing.prc"], "there is no such checkpoint"),
        (["-o", "o.exr", "o.txt"], "damaged"),
        (["-o", "o.exr", "part.prc"], "samples 0:2 are also in part.prc"),
        ([], "--output"),
    ],
)
def test_misuse_of_merge(
    flags: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    save(run(sample_range=(0, 2)), Path("part.prc"))
    Path("o.txt").write_text("a text")
    before = sorted(p.name for p in tmp_path.iterdir())
    assert primray_command(["merge", "part.prc", *flags]) == 2
    assert says in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == before
