"""RayParts over an executor of this machine in place of a cluster: real workers, their messages and files, no Ray."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.scenes import BROKEN
from tests.service.faults import descendants
from tests.service.losing import KillsUntilLost

import primray
from primray.errors import PrimrayError, SettingsError
from primray_service.executor.local import LocalExecutor
from primray_service.executor.ray import link
from primray_service.farm import ray_parts
from primray_service.farm.ray_parts import RayParts
from primray_service.files import DataDirectory
from primray_service.limits import Limits

SCENE = Path(__file__).parents[3] / "scenes/features/glass/scene.usda"
SIZE = (32, 24)


class OneMachine(LocalExecutor):
    def __init__(self, data: DataDirectory, limits: Limits, **cluster: Any) -> None:
        super().__init__(data, limits, slots=2, cores=2, warm=False)


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> Iterator[RayParts]:
    monkeypatch.setattr(ray_parts, "RayExecutor", OneMachine)
    with RayParts() as made:
        yield made


def workers() -> list[int]:
    """With what is around them."""
    return [pid for pid in descendants(os.getpid()) if b"primray_service.worker" in command_of(pid)]


def command_of(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def test_two_frames(parts: RayParts) -> None:
    for seed in (1, 2):
        image = primray.render(SCENE, resolution=SIZE, spp=24, seed=seed, executor=parts)
        one = primray.render(SCENE, resolution=SIZE, spp=24, seed=seed)
        assert image.report["pixels_sha256"] == one.report["pixels_sha256"]
        assert image.report["distribution"]["lost"] == 0


def test_workers_that_are_killed(parts: RayParts) -> None:
    with KillsUntilLost(parts, workers) as kills:
        image = primray.render(SCENE, resolution=SIZE, spp=4000, progress=kills, executor=parts)
    assert kills.killed
    assert image.report["distribution"]["lost"] >= 1
    assert image.report["pixels_sha256"] == primray.render(SCENE, resolution=SIZE, spp=4000).report["pixels_sha256"]


def test_errors_of_the_scene(parts: RayParts, tmp_path: Path) -> None:
    with pytest.raises(PrimrayError) as raised:
        primray.render(SCENE, camera="/none", spp=8, executor=parts)
    assert "/none" in str(raised.value)
    (tmp_path / "broken.usda").write_text(BROKEN)
    with pytest.raises(PrimrayError):
        primray.render(tmp_path / "broken.usda", spp=8, executor=parts)


def test_a_session_layer_stays_here(parts: RayParts) -> None:
    with pytest.raises(SettingsError) as raised:
        primray.render(SCENE, session_layer=str(SCENE), spp=8, executor=parts)
    assert (raised.value.code, raised.value.where) == ("parts-setting", "session_layer")


def test_ray_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    with RayParts() as parts, pytest.raises(PrimrayError) as raised:
        primray.render(SCENE, spp=8, executor=parts)
    assert raised.value.code == "ray-missing"
