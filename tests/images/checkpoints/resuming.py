"""What the tests of checkpoints and merging share: small scenes built once, and renders of them that are cut anywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.kernels.scenes import SCENES

from primray import core
from primray.checkpoints.checkpoint import CheckpointInfo, contents, identity, load, resume, resumed_settings
from primray.checkpoints.checkpoint_file import write_checkpoint
from primray.description import Camera, Projection
from primray.description.scene import whole_frame
from primray.images.image import pixels_sha256
from primray.sampling.sampling import Sampling
from primray.settings import RenderSettings, settings_as_json

CAMERA = Camera("/camera", np.eye(4), Projection.PERSPECTIVE, (-1.0, 1.0, -1.0, 1.0), (0.1, 100.0))
ROOT = Path(__file__).parents[3]
STAGE = ROOT / "scenes/features/implicit-shapes/scene.usda"
LONG = 1 << 20  # samples that no machine takes while a test waits
DIGESTS = {name: name * 2 for name in ("geometry", "materials", "lights", "camera")}


def reached(next_samples: Any) -> int:
    """The samples a pixel of a render that was stopped somewhere, when all pixels have as many as the first ones."""
    return 2 * int(next_samples.max())


@cache
def scene(name: str = "materials") -> core.CoreScene:
    description = SCENES[name]().description
    return core.CoreScene(SCENES[name]().build(), 1.0, [], description.resolution)


def settings(**values: Any) -> RenderSettings:
    """Resolved, as far as checkpoints look at it."""
    return RenderSettings(**{"resolution": scene().resolution, "filter": "box", "filter_width": 1.0, "threads": 2, **values})


def begin(**values: Any) -> Sampling:
    sampling = Sampling.begin(scene(), settings(**values))
    sampling.schedule = replace(sampling.schedule, resumable=True)
    return sampling


def run(**values: Any) -> Sampling:
    """Through to the end."""
    sampling = begin(**values)
    assert sampling.run()
    return sampling


def about(of: RenderSettings, **changes: Any) -> CheckpointInfo:
    assert of.resolution is not None
    return CheckpointInfo(
        identity(of, DIGESTS) | changes, settings_as_json(of), CAMERA, whole_frame(*of.resolution), {"triangles": 2}, [], []
    )


def save(sampling: Sampling, path: Path, **changes: Any) -> Path:
    write_checkpoint(path, *contents(sampling, about(sampling.settings, **changes)))
    return path


def go_on(path: Path, **values: Any) -> Sampling:
    held = load(path)
    chosen = resumed_settings(settings(**values), held)
    sampling = resume(scene(), chosen, about(chosen), held)
    sampling.schedule = replace(sampling.schedule, resumable=True)
    return sampling


def sha256(sampling: Sampling) -> str:
    return pixels_sha256(sampling.film.image()[0])


def assert_same(a: Sampling, b: Sampling) -> None:
    """Films to the last bit, and the figures that rest on them."""
    assert a.film.samples == b.film.samples
    first, second = a.film.state(), b.film.state()
    for name in first:
        np.testing.assert_array_equal(first[name], second[name], name)
    assert sha256(a) == sha256(b)
    assert a.rows[-1].error.as_json() == b.rows[-1].error.as_json()
    assert a.done == b.done


class Cutter:
    """Stands in for core.render_pass: now and then a pass ends anywhere, as an interruption would have it."""

    def __init__(self, rng: np.random.Generator, share: float = 0.7) -> None:
        self.rng = rng
        self.share = share
        self.cuts = 0
        self._render_pass: Callable[..., core.Pass] = core.render_pass

    def __call__(self, scene: Any, film: core.Film, ends: Any, splits: core.Splits, settings: Any, progress: Any) -> core.Pass:
        if self.rng.random() > self.share:
            return self._render_pass(scene, film, ends, splits, settings, progress)
        self.cuts += 1
        start = film.next.astype(np.int64)
        left = np.maximum(ends.astype(np.int64) - start, 0)
        part = start + (left * self.rng.random(left.shape[1]) * self.rng.integers(0, 2, left.shape[1])).astype(np.int64)
        done = self._render_pass(scene, film, part.astype(np.uint32), splits, settings, None)
        return core.Pass(True, done.seconds, done.busy_lanes, done.shaded_lanes)


@pytest.fixture
def cutter(monkeypatch: pytest.MonkeyPatch) -> Cutter:
    made = Cutter(np.random.default_rng(7))
    monkeypatch.setattr(core, "render_pass", made)
    return made
