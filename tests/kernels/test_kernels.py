"""The same image from every kernel, number of threads and module; and renders that are stopped, interrupted or simultaneous."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.described import ISAS, core_module, render, replicate_means
from tests.kernels.scenes import SCENES, grouped

from primray.settings import Filter

ROOT = Path(__file__).parents[2]
SPP = 20  # more than one block of a replicate would be 34: see test_threads


def sha256(result: Any) -> str:
    return hashlib.sha256(result.pixels(1.0).tobytes()).hexdigest()


def lane_counts(isa: str) -> list[int]:
    return [n for n in (1, 4, 8, 16) if n <= core_module(isa).MAX_LANES]


@pytest.mark.parametrize("isa", ISAS)
@pytest.mark.parametrize("name", SCENES)
def test_lanes_give_the_same_bits(name: str, isa: str) -> None:
    scene = SCENES[name]().build(isa, Filter.BLACKMAN_HARRIS)
    images = {lanes: render(scene, SPP, isa=isa, lanes=lanes) for lanes in lane_counts(isa)}
    assert all(r.invalid_samples == 0 for r in images.values())
    assert len({sha256(r) for r in images.values()}) == 1
    assert len({(r.camera_rays, r.scattered_rays, r.shadow_rays) for r in images.values()}) == 1
    assert images[1].pixels(1.0)[..., :3].max() > 0.05


@pytest.mark.parametrize("name", SCENES)
def test_threads_give_the_same_bits(name: str) -> None:
    scene = SCENES[name]().build()
    # 70 samples are three blocks of each replicate.
    assert len({sha256(render(scene, 70, threads=threads)) for threads in (1, 2, 5)}) == 1


@pytest.mark.parametrize("name", SCENES)
def test_modules_agree(name: str) -> None:
    """Bits may differ from class to class, the image may not: all of the same samples, so almost all pixels are equal."""
    means = [replicate_means(render(SCENES[name]().build(isa), 16, isa=isa)).mean(axis=0) for isa in ISAS]
    for m in means[1:]:
        scale = means[0].mean()
        assert np.median(np.abs(m - means[0])) < 1e-5 * scale
        assert abs(m.mean() - means[0].mean()) < 5e-3 * scale


def test_two_levels_give_the_picture_of_one() -> None:
    """All of the same samples, so that pixels differ only where rounding makes a ray just miss."""
    two, one = (replicate_means(render(grouped(flat).build(), 64)).mean(axis=0) for flat in (False, True))
    assert np.median(np.abs(two - one)) < 1e-5 * one.mean()
    assert abs(two.mean() - one.mean()) < 2e-3 * one.mean()


def test_seeds_differ() -> None:
    scene = SCENES["all lights"]().build()
    images = [render(scene, 8, seed=seed).pixels(1.0) for seed in (0, 1, 2**32 - 1)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert np.mean(images[a] != images[b]) > 0.5


def test_replicates_are_independent_halves() -> None:
    result = render(SCENES["all lights"]().build(), 9)
    assert (result.counts[0] == 5).all()
    assert (result.counts[1] == 4).all()
    a, b = replicate_means(result)
    assert np.mean(a != b) > 0.5


def test_two_renders_at_once() -> None:
    scenes = {name: SCENES[name]().build() for name in ("materials", "instances")}
    alone = {name: sha256(render(scene, 16)) for name, scene in scenes.items()}
    together: dict[str, str] = {}

    def run(name: str) -> None:
        together[name] = sha256(render(scenes[name], 16, threads=2))

    threads = [threading.Thread(target=run, args=(name,)) for name in scenes]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert together == alone


def test_stopping_leaves_a_valid_image() -> None:
    scene = SCENES["materials"]().build()
    whole = render(scene, 4096, progress=lambda fraction: fraction < 0.02)
    assert whole.interrupted
    assert 0 < whole.samples < 4096 * 37 * 23
    counts = whole.counts.sum(axis=0)
    assert counts.sum() + whole.invalid_samples == whole.samples
    pixels = whole.pixels(1.0)
    assert np.isfinite(pixels).all()
    # A pixel's samples are the first of its sequence: it equals the same pixel of a shorter render.
    done = counts == 32
    if done.any():
        np.testing.assert_array_equal(pixels[done], render(scene, 32).pixels(1.0)[done])


def test_progress_that_raises_is_passed_on() -> None:
    def progress(fraction: float) -> bool:
        raise RuntimeError("from the callback")

    with pytest.raises(RuntimeError, match="from the callback"):
        render(SCENES["materials"]().build(), 4096, progress=progress)


INTERRUPTED = """
import os, queue, signal, threading
from tests.described import render
from tests.kernels.scenes import SCENES
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs start with it ignored
scene = SCENES["materials"]().build()
fractions = queue.SimpleQueue()  # its put() runs no bytecode, in which Python would raise the interrupt itself


def interrupt():
    while not fractions.get() > 0:  # the pass has begun
        pass
    os.kill(os.getpid(), signal.SIGINT)


threading.Thread(target=interrupt).start()
result = render(scene, 1 << 20, progress=fractions.put)
assert result.interrupted and 0 < result.samples < (1 << 20) * 37 * 23, result.samples
print("interrupted", int((result.counts.sum(axis=0) > 0).sum()))
"""


def test_keyboard_interrupt() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "renderer"), str(ROOT)])}
    run = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=60, cwd=ROOT, env=environment
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("interrupted")
