"""Data sets are the same bytes whatever ended them, however many processes made them, and whatever else varies."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray import Image
from primray.dataset import Config, Sampler, make, samples_of, verify
from primray.dataset.ledger import finished, new_sample, sample_folder
from primray.dataset.workers import Done, LocalWorkers
from primray.errors import InternalError, PrimrayError, SettingsError

from .room import config_in, plain_config, write_room

pytest.importorskip("yaml", reason="no PyYAML")

TINY = {"resolution": [8, 6], "spp": 1, "max_depth": 1}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file() and p.name != ".lock"}


def write_config(folder: Path, **changes: Any) -> Path:
    write_room(folder)
    path = folder / "set.yaml"
    path.write_text(json.dumps(plain_config(**changes)))
    return path


COMMAND = [sys.executable, "-c", "from primray.cli import main; main()", "dataset"]


def killed_until_done(command: list[str], folder: Path, seed: int, most: int, end: int) -> int:
    """Start a command again and again, and kill it a moment after some samples more are done; return the number of kills.

    Its workers end when nobody gives them orders any more; they may still finish a sample. No sample may be made twice.
    """
    moments, kills = random.Random(seed), 0
    first_made: dict[int, int] = {}
    while len(finished(folder)) < end:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        wanted = len(finished(folder)) + moments.randint(0, most)
        while process.poll() is None and len(finished(folder)) < wanted:
            time.sleep(0.01)
        time.sleep(moments.uniform(0, 0.1))
        if process.poll() is not None:
            assert process.returncode == 0, process.stderr and process.stderr.read().decode()
            break
        process.send_signal(signal.SIGKILL)
        process.wait()
        kills += 1
        for index in finished(folder):
            inode = sample_folder(folder, index).stat().st_ino
            assert first_made.setdefault(index, inode) == inode, "it was made twice"
    return kills


def test_kills_change_no_byte_and_no_picture_is_made_twice(tmp_path: Path) -> None:
    config = write_config(tmp_path, samples=40, settings=TINY, pictures=["png"])
    assert make(Config.read(config), tmp_path / "whole", processes=2).rendered == 40
    part = tmp_path / "part"
    command = [*COMMAND, str(config), "-o", str(part), "-n", "2"]
    kills = killed_until_done(command, part, 5, most=12, end=36)
    made_before = {index: sample_folder(part, index).stat().st_ino for index in finished(part)}
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0
    assert kills  # how many depends on how busy the machine is
    assert {index: sample_folder(part, index).stat().st_ino for index in made_before} == made_before
    assert contents(part) == contents(tmp_path / "whole")
    assert not [p for p in (part / "samples").iterdir() if p.name.startswith(".")]


@pytest.mark.long
def test_two_thousand_pictures_are_the_same_bytes_with_kills(tmp_path: Path) -> None:
    config = write_config(tmp_path, samples=2000, settings=TINY, pictures=["png"])
    begun = time.process_time()
    assert make(Config.read(config), tmp_path / "whole", processes=2).rendered == 2000
    part = tmp_path / "part"
    command = [*COMMAND, str(config), "-o", str(part), "-n", "2"]
    kills = killed_until_done(command, part, 5, most=300, end=1990)
    assert subprocess.run(command, check=False).returncode == 0
    assert kills >= 8
    assert contents(part) == contents(tmp_path / "whole")
    print(f"{kills} kills, {time.process_time() - begun:.0f} CPU seconds here")


class DyingWorkers:
    """Workers on this machine, beside one that dies while it writes a sample that they make too."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def run(self, order: Mapping[str, Any], samples: Sequence[int], done: Done) -> None:
        LocalWorkers(1).run(order, samples, done)
        partial = self._folder / "samples" / ".000001.1534.a3eda415"
        partial.mkdir()
        (partial / "depth.npy").write_bytes(b"half of")


def test_nothing_is_left_of_a_worker_that_died_while_it_wrote(tmp_path: Path) -> None:
    config = config_in(tmp_path, samples=2)
    make(config, tmp_path / "set", executor=DyingWorkers(tmp_path / "set"))
    make(config, tmp_path / "whole")
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


def test_the_number_of_processes_and_threads_changes_no_byte(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    make(config, tmp_path / "one", processes=1, threads=1)
    make(config, tmp_path / "three", processes=3, threads=2)
    assert contents(tmp_path / "one") == contents(tmp_path / "three")


def test_a_sample_is_that_of_a_new_render_of_its_stage(tmp_path: Path) -> None:
    """The third sample of a scene that stays, and the same without any before it."""
    config = config_in(tmp_path)
    kept = Sampler(config)
    for index in (0, 1):
        kept.render(index)
    third, new = kept.render(2), Sampler(config).render(2)
    assert third[1] == new[1]
    assert isinstance(third[0], Image)
    assert isinstance(new[0], Image)
    assert np.array_equal(third[0].pixels, new[0].pixels)


def test_a_variation_more_changes_nothing_that_others_draw(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    more = {"sky": {"attribute": "/World/sky.inputs:intensity", "to": {"uniform": [0, 1]}}, **config.plain["vary"]}
    before, _ = Sampler(config).apply(1)
    after, _ = Sampler(config_in(tmp_path, vary=more)).apply(1)
    assert {name: after[name] for name in before} == before
    assert Sampler(config).apply(2)[0] != before
    assert Sampler(config_in(tmp_path, seed=8)).apply(1)[0] != before


def test_samples_may_be_added_and_nothing_else_may_change(tmp_path: Path) -> None:
    config, folder = config_in(tmp_path), tmp_path / "set"
    make(config, folder)
    before = contents(folder / "samples")
    made = make(config_in(tmp_path, samples=4), folder)
    assert (made.samples, made.rendered) == (4, 1)
    after = contents(folder / "samples")
    assert {name: after[name] for name in before} == before
    assert make(config_in(tmp_path, samples=4), folder).rendered == 0
    for changes, says in (({"seed": 8}, "setting seed: 7 when"), ({"settings": TINY}, r"setting settings.resolution\[0\]")):
        with pytest.raises(SettingsError, match=says) as caught:
            make(config_in(tmp_path, **changes), folder)
        assert caught.value.code == "dataset-changed"
    stage = tmp_path / "room.usda"
    stage.write_text(stage.read_text().replace("0.5, 0.5, 0.5", "0.5, 0.5, 0.4"))
    with pytest.raises(SettingsError, match=r"input room\.usda"):
        make(config, folder)


def test_a_sample_that_another_worker_finished_first_is_let_go_unless_it_differs(tmp_path: Path) -> None:
    record = {"pixels_sha256": "a", "aovs_sha256": {}}
    for _ in range(2):
        with new_sample(tmp_path, 0) as place:
            (place / "sample.json").write_text(json.dumps(record))
    assert finished(tmp_path) == [0]
    with pytest.raises(InternalError, match="other pixels"), new_sample(tmp_path, 0) as place:
        (place / "sample.json").write_text(json.dumps({**record, "pixels_sha256": "b"}))
    assert [p.name for p in (tmp_path / "samples").iterdir()] == ["000000"]


def test_two_runs_at_once_are_refused(tmp_path: Path) -> None:
    from primray.dataset.ledger import locked

    with locked(tmp_path), pytest.raises(SettingsError, match="another process") as caught, locked(tmp_path):
        pass
    assert caught.value.code == "dataset-busy"


def test_a_sample_that_cannot_be_made_says_which(tmp_path: Path) -> None:
    props = {"scatter": "/World/props/*", "surface": "/World/table", "gap": {"x": 1}}
    with pytest.raises(SettingsError, match="a number"):
        config_in(tmp_path, vary={"props": props})
    crowded = config_in(tmp_path, vary={"props": {**props, "gap": 5}})
    with pytest.raises(PrimrayError, match="no place was found") as caught:
        make(crowded, tmp_path / "set")
    assert caught.value.code == "dataset-crowded"
    assert caught.value.where.startswith("sample 0: config: vary.props: /World/props/")


def test_a_worker_that_dies_is_replaced_and_one_that_dies_always_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dies = tmp_path / "dies.py"
    dies.write_text(
        "import os, sys, pathlib\n"
        "from primray.dataset import worker\n"
        "def make(self, index):\n"
        "    once = pathlib.Path(os.environ['ONCE'])\n"
        "    if index == 1 and not once.exists():\n"
        "        os.environ.get('ALWAYS') or once.touch()\n"
        "        print('out of luck', file=sys.stderr, flush=True)\n"
        "        os.kill(os.getpid(), 9)\n"
        "    return was(self, index)\n"
        "was, worker.Worker.make = worker.Worker.make, make\n"
        "worker.main(sys.stdin, sys.stdout)\n"
    )
    monkeypatch.setattr("primray.dataset.workers.PROGRAM", "dies")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]))
    monkeypatch.setenv("ONCE", str(tmp_path / "once"))
    config = config_in(tmp_path, settings=TINY)
    assert make(config, tmp_path / "set").rendered == 3
    monkeypatch.setenv("ALWAYS", "1")
    (tmp_path / "once").unlink()
    with pytest.raises(PrimrayError, match="ended 2 times, with -9: out of luck") as caught:
        make(config, tmp_path / "other")
    assert (caught.value.code, caught.value.where) == ("dataset-worker", "sample 1")


def test_poses_of_a_file_are_those_of_the_samples(tmp_path: Path) -> None:
    poses = np.tile(np.eye(4), (2, 1, 1, 1))
    poses[1, 0, :3, 3] = 1, 2, 3
    np.save(tmp_path / "poses.npy", poses)
    config = config_in(tmp_path, vary={"p": {"pose": "/World/props/c", "from": "poses.npy"}})
    sampler = Sampler(config)
    for index, row in ((0, 0), (1, 1), (3, 1)):
        assert sampler.apply(index)[0]["p"]["row"] == row
        assert np.allclose(sampler._varied.world_from("/World/props/c"), poses[row, 0])
    assert "poses.npy" in config.files


def test_poses_turn_scale_and_move(tmp_path: Path) -> None:
    vary = {"p": {"pose": "/World/props/c", "translate": [1, 2, 3], "rotate": [0, 90, 0], "scale": 2}}
    sampler = Sampler(config_in(tmp_path, vary=vary))
    for index in (0, 1):
        sampler.apply(index)
        world = sampler._varied.world_from("/World/props/c")
        assert world[:3, 3] == pytest.approx([1, 2, 3])
        assert world[:3, :3] == pytest.approx(np.diag([0.3, 0.9, 0.3]) @ np.array([[0, 0, 2], [0, 2, 0], [-2, 0, 0]]), abs=1e-6)


def test_cameras_look_at_their_target_from_the_shell(tmp_path: Path) -> None:
    view = {"shell": [1, 0, 0], "distance": [2, 3], "elevation": [10, 30], "azimuth": [0, 90], "field_of_view": 50}
    sampler = Sampler(config_in(tmp_path, vary={"view": view}))
    found = [sampler.apply(k) for k in range(200)]
    for drawn, settings in found:
        eye = np.array(drawn["view"]["eye"])
        away = eye - [1, 0, 0]
        assert 2 <= np.linalg.norm(away) <= 3
        assert 10 <= np.degrees(np.arcsin(away[1] / np.linalg.norm(away))) <= 30
        assert settings["camera"].project([[1, 0, 0]], (16, 12))[0] == pytest.approx([8, 6])
    heights = np.array([np.sin(np.radians(drawn["view"]["elevation"])) for drawn, _ in found])
    low, high = np.sin(np.radians([10, 30]))
    assert abs(heights.mean() - (low + high) / 2) < 4 * (high - low) / np.sqrt(12 * 200)


def test_records_say_what_was_drawn_and_what_is_where(tmp_path: Path) -> None:
    make(config_in(tmp_path), tmp_path / "set")
    samples = list(samples_of(tmp_path / "set"))
    assert [sample.index for sample in samples] == [0, 1, 2]
    record = samples[0].record
    assert set(record["varied"]) == {"lamp", "colours", "props", "view"}
    assert samples[0].aov("depth").shape == (12, 16, 1)
    assert samples[0].file("picture").read_bytes()[:4] == b"\x89PNG"
    k = np.array(record["camera"]["intrinsics"])
    assert k[0, 2] == pytest.approx(7.5)


def test_variants_vary(tmp_path: Path) -> None:
    write_room(tmp_path)
    stage = tmp_path / "room.usda"
    text = stage.read_text().replace(
        'def Cube "a" (',
        'def Cube "a" (\n            variants = {string look = "small"}\n            prepend variantSets = "look"',
        1,
    )
    text = text.replace("            double size = 0.5\n", "", 1).replace(
        "0.8, 0.1, 0.1)]\n",
        '0.8, 0.1, 0.1)]\n            variantSet "look" = {\n                "small" {\n double size = 0.2\n }\n'
        '                "large" {\n double size = 0.7\n }\n            }\n',
        1,
    )
    stage.write_text(text)
    vary = {"look": {"variant": "/World/props/a:look"}, "props": plain_config()["vary"]["props"]}
    config = config_in(tmp_path, vary=vary)
    sampler = Sampler(config)
    sizes = {}
    for index in range(8):
        drawn, _ = sampler.apply(index)
        sizes[drawn["look"]] = drawn["props"]["/World/props/a"][1][3]
    assert sizes == {"small": pytest.approx(0.1), "large": pytest.approx(0.35)}
    with pytest.raises(SettingsError, match="did you mean large"):
        Sampler(config_in(tmp_path, vary={"look": {"variant": "/World/props/a:look", "to": {"choice": ["larg"]}}})).check()


def test_what_is_killed_while_packing_is_packed_again(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    make(config_in(tmp_path), folder)
    shutil.rmtree(folder / "samples/000001")
    assert make(config_in(tmp_path), folder).rendered == 1


def test_without_light_labels_and_aovs_are_those_of_the_pictures(tmp_path: Path) -> None:
    both = {"labels": {"classes": ["ball", "box", "can"]}, "pictures": ["npy"]}
    lit, unlit = config_in(tmp_path, **both), config_in(tmp_path, **both, light=False, write=["hdf5"])
    make(lit, tmp_path / "lit")
    made = make(unlit, tmp_path / "unlit")
    for one, other in zip(samples_of(tmp_path / "lit"), samples_of(made.folder), strict=True):
        assert one.things
        assert one.things == other.things
        assert one.record["aovs_sha256"] == other.record["aovs_sha256"]
        assert one.record["varied"] == other.record["varied"]
        assert np.array_equal(one.index_map, other.index_map)
        assert one.record["pixels_sha256"]
        assert other.record["pixels_sha256"] is None
    assert verify(made.folder, share=1).difference is None


def test_without_light_nothing_is_sampled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("a sample was taken")

    monkeypatch.setattr("primray.core.render_pass", refuse)
    monkeypatch.setattr("primray.core.choose_splits", refuse)
    config = config_in(tmp_path, pictures=["npy"], light=False)
    image, record = Sampler(config).render(0)
    assert image.aovs["depth"].values.shape == (12, 16, 1)
    assert record["pixels_sha256"] is None
    with pytest.raises(AssertionError, match="a sample was taken"):
        Sampler(config_in(tmp_path)).render(0)
