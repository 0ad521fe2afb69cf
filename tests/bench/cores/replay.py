"""How much of a render's time Embree needs alone: its rays, recorded in order and the way each was traced, are traced again.

Both run on one thread, by turns, in one process; the figure is Embree's seconds over the render's, its median and range.
"""

from __future__ import annotations

import statistics
from typing import Any

from tests.bench.scenes import BenchScene

from primray import core, usd
from primray.diagnostics import Diagnostics
from primray.render import load_textures
from primray.settings import Filter, RenderSettings


def build(scene: BenchScene, spp: int) -> tuple[core.CoreScene, RenderSettings]:
    settings = RenderSettings(
        camera=scene.camera,
        resolution=scene.resolution,
        spp=spp,
        max_depth=scene.max_depth,
        filter=Filter.BOX,
        threads=1,
        time_code=scene.time_code,
    )
    diagnostics = Diagnostics()
    stage = usd.open_stage(str(scene.path), diagnostics)
    description, translating = usd.translate(stage, settings)
    diagnostics.extend(translating)
    description, textures = load_textures(description, diagnostics, usd.read_asset)
    return core.build(description, textures, settings), settings


def measure(scene: BenchScene, spp: int, repetitions: int) -> dict[str, Any]:
    built, settings = build(scene, spp)
    recording = core.Recording(built, settings)
    splits = core.choose_splits(built, settings)
    runs = []
    for _ in range(repetitions):
        film = core.Film(built)
        done = core.render_pass(built, film, core.uniform_ends(film, spp), splits, settings)
        runs.append((done.seconds, recording.replay_s()))
    shares = sorted(embree / render for render, embree in runs)
    return {
        "scene": scene.name,
        "lanes": core.lanes(),
        "isa": core.isa(),
        "samples": film.samples,
        "rays": film.rays,
        "splits": splits.paths,
        "light_samples": splits.lights,
        "lane_occupancy": round(done.busy_lanes / done.shaded_lanes, 4),
        "render_s": [round(render, 4) for render, _ in runs],
        "embree_s": [round(embree, 4) for _, embree in runs],
        "embree_share_median": round(statistics.median(shares), 4),
        "embree_share_range": [round(shares[0], 4), round(shares[-1], 4)],
    }
