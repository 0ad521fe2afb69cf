"""Converged pictures of the compared scenes, one for each renderer: python -m tests.bench.references [--seconds S] [SCENE ...].

They are kept where the scenes are (peer_runs.kept) and made where they are missing. Renderers differ a little in what they
make of a scene, so each is held against its own.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from .peer_runs import digest, kept, run
from .peers.installed import Renderer, installed
from .peers.scenes import SCENES
from .relmse import Reference, load, reference_of, save, saved

SECONDS = 40.0
SAMPLES = 64  # a picture
FIRST_SEED = 70_000  # curves use small ones


def path_of(scene: str, peer: str) -> Path:
    return kept() / "references" / f"{scene}_{digest(scene)}_{peer}.npz"


def reference(renderer: Renderer, scene: str, seconds: float = SECONDS) -> Reference:
    """The peer's, whatever the variant; made by this one if it is missing."""
    path = path_of(scene, renderer.peer)
    if not path.exists():
        with tempfile.TemporaryDirectory() as folder:
            pictures = [(SAMPLES, FIRST_SEED + k) for k in range(256)]
            rows = run(renderer, scene, pictures, Path(folder), limit_s=1e9, total_s=seconds)
            found = [load(row["path"]) for row in rows if row["what"] == "picture"]
        save(reference_of(found, SAMPLES), path)
    return saved(path)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.references", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for each picture that is missing")
    options = parser.parse_args()
    for scene in options.scenes:
        seen = set()
        for renderer in installed(scene):
            if renderer.peer not in seen:
                seen.add(renderer.peer)
                made = reference(renderer, scene, options.seconds)
                print(f"{scene:8} {renderer.peer:8} {made.samples:6} samples, noise {made.noise:.2e}", flush=True)


if __name__ == "__main__":
    main()
