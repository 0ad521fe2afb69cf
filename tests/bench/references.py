"""Converged pictures of the compared scenes, one for each renderer.

    python -m tests.bench.references [--seconds S] [--more] [SCENE ...]

They are kept where the scenes are (peer_runs.kept) and made where they are missing. Renderers differ a little in what they
make of a scene, so each is held against its own; on scenes that move, where what they mean is the same to all of them
(moving_scenes.py), all are held against ours.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from tests.bench.figures.relmse import Reference, load, reference_of, save, saved

from .peer_runs import digest, kept, run
from .peers.installed import MOVING, OURS, Renderer, installed
from .peers.scenes import SCENES

SECONDS = 40.0
SAMPLES = 64  # a picture
MOST_PICTURES = 64  # at once
FIRST_SEED = 70_000  # curves use small ones


def path_of(scene: str, peer: str) -> Path:
    return kept() / "references" / f"{scene}_{digest(scene)}_{peer}.npz"


def reference(renderer: Renderer, scene: str) -> Reference:
    """The peer's, whatever the variant; made by this one if it is missing."""
    path = path_of(scene, renderer.peer)
    return saved(path) if path.exists() else refine(renderer, scene, SECONDS)


def refine(renderer: Renderer, scene: str, seconds: float) -> Reference:
    """Adds pictures for so many seconds, two at least."""
    path = path_of(scene, renderer.peer)
    known = saved(path) if path.exists() else None
    first = FIRST_SEED + (known.pictures if known else 0)
    with tempfile.TemporaryDirectory() as folder:
        pictures = [(SAMPLES, first + k) for k in range(MOST_PICTURES)]
        rows = run(renderer, scene, pictures, Path(folder), limit_s=1e9, total_s=seconds)
        found = [load(row["path"]) for row in rows if row["what"] == "picture"]
    made = reference_of(found, SAMPLES)
    made = made if known is None else known.with_more(made)
    save(made, path)
    return made


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.references", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for each")
    parser.add_argument("--more", action="store_true", help="add to those that are there as well")
    options = parser.parse_args()
    for scene in options.scenes:
        seen = set()
        for renderer in installed(scene):
            if renderer.peer not in seen and (renderer.peer == OURS or scene not in MOVING):
                seen.add(renderer.peer)
                path = path_of(scene, renderer.peer)
                made = saved(path) if path.exists() and not options.more else refine(renderer, scene, options.seconds)
                print(f"{scene:8} {renderer.peer:8} {made.samples:6} samples, noise {made.noise:.2e}", flush=True)


if __name__ == "__main__":
    main()
