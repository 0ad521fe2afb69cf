"""Machines that are not trusted: cheats of three kinds are found within the stated number of parts, and honest ones are not."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.checkpoints.checkpoint import load
from primray.checkpoints.checkpoint_file import read_checkpoint, write_checkpoint
from primray.checkpoints.merge import merge
from primray.distributed.executor import PartLost, PartsWithdrawn
from primray.distributed.local_processes import render_part
from primray.distributed.spot_checks import RefusedPart, SpotChecked, TrustedScene, chance_to_pass
from primray.errors import PrimrayError, SettingsError
from primray.pinned.lock import hashes_of_tiles
from primray.settings import RenderSettings

from ..pinned.shot import write_shot

SIZE = (64, 48)  # 12 tiles
SETTINGS = RenderSettings(resolution=SIZE, threads=2, sample_range=(8, 16), max_depth=3)
Cheat = Callable[[Path, RenderSettings, Path], None]  # leaves a part at the last path; the first is the stage


def honest(stage: Path, settings: RenderSettings, file: Path) -> None:
    render_part(str(stage), settings, file)


def wrong_bits(stage: Path, settings: RenderSettings, file: Path, tiles: tuple[int, ...] = (5,)) -> None:
    """An honest part in which one pixel of some tiles is another in its last bit."""
    render_part(str(stage), settings, file)
    header, arrays = read_checkpoint(file)
    arrays = {name: np.array(values) for name, values in arrays.items()}
    for tile in tiles:
        arrays["film.parts"][1, tile // 4 * 16 + 3, tile % 4 * 16 + 7, 2, 0] += 1 << 40
    write_checkpoint(file, {name: value for name, value in header.items() if name != "arrays"}, arrays)


def right_looking_noise(stage: Path, settings: RenderSettings, file: Path) -> None:
    """Samples with another seed, under the header of the part that was asked for: mean and error are right."""
    other = file.with_name("other.prc")
    render_part(str(stage), settings, file)
    render_part(str(stage), replace(settings, seed=99), other)
    header = {name: value for name, value in read_checkpoint(file)[0].items() if name != "arrays"}
    write_checkpoint(file, header, read_checkpoint(other)[1])
    other.unlink()


def replayed(stage: Path, settings: RenderSettings, file: Path) -> None:
    """The first samples, sold as those that were asked for, with all that counts them put right."""
    assert settings.sample_range is not None
    first, end = settings.sample_range
    other = file.with_name("other.prc")
    render_part(str(stage), settings, file)
    render_part(str(stage), replace(settings, sample_range=(end, 2 * end - first)), other)
    header, arrays = read_checkpoint(file)
    arrays = {**read_checkpoint(other)[1], "film.next": arrays["film.next"]}
    write_checkpoint(file, {name: value for name, value in header.items() if name != "arrays"}, arrays)
    other.unlink()


def replayed_as_it_is(stage: Path, settings: RenderSettings, file: Path) -> None:
    render_part(str(stage), replace(settings, sample_range=(0, 8)), file)


CHEATS = (wrong_bits, right_looking_noise, replayed, replayed_as_it_is)


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return write_shot(tmp_path / "set")


def fault(stage: Path, file: Path, tiles: int, seed: int = 0, settings: RenderSettings = SETTINGS) -> str | None:
    assert settings.sample_range is not None
    scene = TrustedScene(str(stage), settings)
    return scene.fault_of(load(file), settings.sample_range, np.random.default_rng(seed), tiles)


# One part


def test_an_honest_part_is_accepted_and_written_with_what_is_known_here(stage: Path, tmp_path: Path) -> None:
    part, out = tmp_path / "part.prc", tmp_path / "out.prc"
    honest(stage, SETTINGS, part)
    assert fault(stage, part, 12) is None
    header, arrays = read_checkpoint(part)
    header["camera"]["exposure_scale"] = 5.0  # which the header of a part could say
    write_checkpoint(part, {name: value for name, value in header.items() if name != "arrays"}, arrays)
    TrustedScene(str(stage), SETTINGS).write(load(part), (8, 16), out)
    assert load(out).about.camera.exposure_scale == 1.0
    assert load(out).ranges == ((8, 16),)
    for name, values in load(out).film.items():
        assert np.array_equal(values, arrays[f"film.{name}"]), name


@pytest.mark.parametrize("how", [{"clamp_indirect": 2.0}, {"aovs": ("lpe:C<RD>L",)}])
def test_what_is_kept_beside_the_picture_is_compared_too(stage: Path, tmp_path: Path, how: dict[str, Any]) -> None:
    settings = replace(SETTINGS, **how)
    part = tmp_path / "part.prc"
    honest(stage, settings, part)
    assert fault(stage, part, 12, settings=settings) is None
    header, arrays = read_checkpoint(part)
    name = "film.clamped" if "clamp_indirect" in how else "film.routed"
    values = np.array(arrays[name])
    values[..., 20, 30, :, :] += 1 << 45
    write_checkpoint(part, {name: value for name, value in header.items() if name != "arrays"}, {**arrays, name: values})
    assert fault(stage, part, 12, settings=settings) == "pixels 16:32, 16:32 do not have the bits of a render here"


@pytest.mark.parametrize("cheat", [right_looking_noise, replayed, replayed_as_it_is])
def test_whole_cheats_are_found_in_the_first_part_by_one_tile(stage: Path, tmp_path: Path, cheat: Cheat) -> None:
    cheat(stage, SETTINGS, tmp_path / "part.prc")
    why = fault(stage, tmp_path / "part.prc", 1)
    assert why is not None
    assert why == "it has samples 0:8" if cheat is replayed_as_it_is else "do not have the bits of a render here" in why


def test_right_looking_noise_looks_right(stage: Path, tmp_path: Path) -> None:
    """Nothing but its bits tells it from an honest part: the means of both agree within their noise, and so do their errors."""
    parts = [tmp_path / "a.prc", tmp_path / "b.prc"]
    honest(stage, SETTINGS, parts[0])
    right_looking_noise(stage, SETTINGS, parts[1])
    one, other = (merge([part]).image for part in parts)
    assert one.pixels[..., :3].mean() == pytest.approx(other.pixels[..., :3].mean(), rel=0.02)
    assert one.report["error"]["relmse"]["estimate"] == pytest.approx(other.report["error"]["relmse"]["estimate"], rel=0.3)
    assert not set(hashes_of_tiles(one.pixels)) & set(hashes_of_tiles(other.pixels))  # any tile tells


def test_wrong_bits_in_few_tiles_are_found_as_often_as_is_said(stage: Path, tmp_path: Path) -> None:
    """One tile of twelve is wrong: three random ones find it in a quarter of the parts, all twelve in each."""
    wrong_bits(stage, SETTINGS, tmp_path / "part.prc")
    assert fault(stage, tmp_path / "part.prc", 12) == "pixels 16:32, 16:32 do not have the bits of a render here"
    scene, part = TrustedScene(str(stage), SETTINGS), load(tmp_path / "part.prc")
    passed = sum(scene.fault_of(part, (8, 16), np.random.default_rng(seed), 3) is None for seed in range(120))
    assert chance_to_pass(12, 1, 3) == pytest.approx(0.75)
    assert passed / 120 == pytest.approx(0.75, abs=0.12)  # three standard deviations


def test_the_chance_to_pass_is_that_of_drawing_without_repetition() -> None:
    random = np.random.default_rng(3)
    passed = np.mean([set(random.choice(100, 30, replace=False).tolist()) <= set(range(95)) for _ in range(20000)])
    assert chance_to_pass(100, 5, 30) == pytest.approx(passed, abs=0.01)
    assert chance_to_pass(100, 5, 30) < 0.95**30
    assert (chance_to_pass(8, 8, 1), chance_to_pass(8, 1, 8), chance_to_pass(8, 0, 8)) == (0, 0, 1)


def test_the_pages_figures_are_these() -> None:
    """docs/untrusted-machines.md: parts until a cheat in a share of a part's tiles is found by 32."""
    page = (Path(__file__).parents[3] / "docs/untrusted-machines.md").read_text(encoding="utf-8")
    for share, means in ((0.1, "after 1.04 parts"), (0.01, "after 3.6 parts"), (1 / 8160, "after 255 parts")):
        passes = (1 - share) ** 32
        assert f"after {1 / (1 - passes):.3g} parts" in (means, means.replace("3.6", "3.64"))
        assert means in page
    assert (1 - 0.01) ** (32 * 15) < 0.01 < (1 - 0.01) ** (32 * 14)


def test_a_part_of_another_scene_build_or_count_is_refused(stage: Path, tmp_path: Path) -> None:
    part = tmp_path / "part.prc"
    honest(stage, SETTINGS, part)
    header, arrays = read_checkpoint(part)
    plain = {name: value for name, value in header.items() if name != "arrays"}

    def said(**changes: Any) -> str | None:
        write_checkpoint(part, {**plain, **changes}, arrays)
        return fault(stage, part, 1)

    assert said(identity={**header["identity"], "core": "0" * 16}) == "it is of another build: core differs"
    assert said(identity={**header["identity"], "seed": 3}) == "it is of another render: seed differs"
    assert said(identity={**header["identity"], "scene.lights": "0"}) == "it is of another render: scene.lights differs"
    assert said(ranges=[[8, 12]]) == "it has samples 8:12"
    assert said(splits=[2, 1]) == "its paths have other splitting factors"
    other = tmp_path / "other.prc"
    honest(stage, replace(SETTINGS, resolution=(32, 32)), other)  # smaller, under the identity of what was asked for
    write_checkpoint(part, {**plain, "frame": read_checkpoint(other)[0]["frame"]}, read_checkpoint(other)[1])
    assert fault(stage, part, 1) == "it is of another resolution"
    fewer = {**arrays, "film.counts": arrays["film.counts"] - np.uint32(1)}
    write_checkpoint(part, plain, fewer)
    assert fault(stage, part, 1) == "its pixels do not have all of their samples"


def test_outputs_that_cannot_be_checked_are_refused(stage: Path) -> None:
    with pytest.raises(SettingsError, match="depth would come unchecked"):
        TrustedScene(str(stage), replace(SETTINGS, aovs=("depth",)))
    with pytest.raises(SettingsError, match="must be 1 or more"):
        SpotChecked(Workers(stage, {}), tiles=0)


def test_a_machine_whose_own_renders_differ_accuses_nobody(
    stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where two renders of one tile here are not the same, the part may be right."""
    honest(stage, SETTINGS, tmp_path / "part.prc")
    scene, seeds, rendered = TrustedScene(str(stage), SETTINGS), count(5), TrustedScene._rendered

    def with_bad_memory(self: TrustedScene, prepared: Any, *rest: Any) -> Any:
        return rendered(self, replace(prepared, settings=replace(prepared.settings, seed=next(seeds))), *rest)

    monkeypatch.setattr(TrustedScene, "_rendered", with_bad_memory)
    with pytest.raises(PrimrayError, match="its memory is not sound"):
        scene.fault_of(load(tmp_path / "part.prc"), (8, 16), np.random.default_rng(0), 2)


# Frames


class Workers:
    """Renders parts here, in the names of workers that take turns; each may cheat, from some part of its own on."""

    def __init__(self, stage: Path, cheats: dict[str, tuple[Cheat, int]], names: tuple[str, ...] = ("ann", "bob")) -> None:
        self.stage, self.cheats, self.names = stage, cheats, list(names)
        self.turn = 0
        self.rendered: dict[str, int] = dict.fromkeys(names, 0)
        self.begun = 0

    def begin(self, stage: str) -> None:
        self.begun += 1

    def slots(self) -> int:
        return 2 * len(self.names)

    def submit(self, settings: RenderSettings, file: Path) -> Future[str]:
        future: Future[str] = Future()
        name = self.names[self.turn % len(self.names)]
        self.turn += 1
        self.rendered[name] += 1
        cheat, since = self.cheats.get(name, (honest, 0))
        (cheat if self.rendered[name] > since else honest)(self.stage, settings, file)
        future.set_result(name)
        return future

    def exclude(self, worker: str) -> None:
        self.names.remove(worker)

    def end(self) -> None:
        pass


FRAME = RenderSettings(resolution=SIZE, threads=2, spp=32, max_depth=3)


@pytest.fixture
def plain(stage: Path) -> str:
    return str(primray.render(stage, replace(FRAME, adaptive=False)).report["pixels_sha256"])


def test_honest_workers_give_the_bits_of_one_render(stage: Path, plain: str) -> None:
    checked = SpotChecked(Workers(stage, {}), tiles=3, threads=2)
    image = primray.render(stage, FRAME, executor=checked)
    assert image.report["pixels_sha256"] == plain
    assert checked.refused == []
    assert checked.checked == image.report["distribution"]["parts"] > 1


@pytest.mark.parametrize("cheat", CHEATS)
def test_a_cheat_is_found_and_the_picture_has_the_bits_of_one_render(stage: Path, plain: str, cheat: Cheat) -> None:
    """Three kinds in all tiles are found in the first part; wrong bits of one tile are, where all twelve are rendered."""
    told: list[RefusedPart] = []
    workers = Workers(stage, {"bob": (cheat, 0)})
    checked = SpotChecked(workers, tiles=12 if cheat is wrong_bits else 1, threads=2, on_refused=told.append)
    image = primray.render(stage, FRAME, executor=checked)
    assert image.report["pixels_sha256"] == plain
    assert [(found.worker, found.accepted) for found in told] == [("bob", 0)]
    assert workers.names == ["ann"]
    assert workers.begun == 1
    assert primray.render(stage, FRAME, executor=checked).report["pixels_sha256"] == plain
    assert len(checked.refused) == 1


def test_parts_that_were_accepted_before_are_thrown_out(stage: Path, plain: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first part of a cheat is wrong in a tile that was not drawn; the second one gives it away."""
    first: list[tuple[int, int]] = []

    def cheat(stage: Path, settings: RenderSettings, file: Path) -> None:
        if not first:
            first.append(settings.sample_range or (0, 0))
            wrong_bits(stage, settings, file, (0,))
        else:
            right_looking_noise(stage, settings, file)

    fault_of = TrustedScene.fault_of

    def with_luck(self: TrustedScene, part: Any, span: tuple[int, int], *rest: Any) -> str | None:
        return None if [span] == first and workers.begun == 1 else fault_of(self, part, span, *rest)

    monkeypatch.setattr(TrustedScene, "fault_of", with_luck)
    workers = Workers(stage, {"bob": (cheat, 0)})
    checked = SpotChecked(workers, tiles=1, threads=2)
    image = primray.render(stage, FRAME, executor=checked)
    assert [found.accepted for found in checked.refused] == [1]
    assert workers.begun == 2
    assert image.report["pixels_sha256"] == plain


def test_without_honest_workers_the_frame_fails(stage: Path) -> None:
    workers = Workers(stage, {"bob": (right_looking_noise, 0)}, ("bob",))
    workers.exclude = lambda worker: None  # type: ignore[method-assign]  # as if it came again
    with pytest.raises(PrimrayError, match="parts in a row were lost"):
        primray.render(stage, FRAME, executor=SpotChecked(workers, tiles=1, threads=2))


def test_a_part_that_cannot_be_read_is_lost_and_accuses_nobody(stage: Path, plain: str) -> None:
    def torn(stage: Path, settings: RenderSettings, file: Path) -> None:
        honest(stage, settings, file)
        if workers.rendered["bob"] == 1:
            file.write_bytes(file.read_bytes()[:-100])

    workers = Workers(stage, {"bob": (torn, 0)})
    checked = SpotChecked(workers, tiles=1, threads=2)
    image = primray.render(stage, FRAME, executor=checked)
    assert (image.report["distribution"]["lost"], checked.refused) == (1, [])
    assert image.report["pixels_sha256"] == plain


def test_errors_of_parts_are_told_apart() -> None:
    assert not issubclass(PartsWithdrawn, PartLost)
