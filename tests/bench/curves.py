"""Error against seconds, ours beside every installed peer: python -m tests.bench.curves [--rounds N] [--limit S] [SCENE ...].

By turns: in every round each renderer, in a process of its own, makes a first picture of one sample, then pictures of 4, 16,
64 ... samples for as long as one is expected to take no more than the limit. Seconds are those of the picture alone; until
the first picture, from the start of the process; memory is the process's peak. PRIMRAY_PEERS: peers/installed.py. Of a peer
that is not there the rows of its last run stay, with their day and machine.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.bench.figures.relmse import Pixels, Reference, agreement, load, reference_of, relmse, trimmed_relmse

from .peer_runs import digest, facts, run
from .peers.installed import MOVING, OURS, RENDERERS, Renderer, installed, meant_for, reason_against
from .peers.scenes import SCENES
from .references import reference
from .results import latest, write_results

LADDER = (4, 16, 64, 256)
ROUNDS = 2
LIMIT_S = 10.0
MOST_NOISE = 0.01  # relMSE of a converged picture that a trimmed error is taken against


def measure(
    scene: str, rounds: int, limit_s: float, ladder: tuple[int, ...] = LADDER, only: Callable[[Renderer], bool] = lambda _: True
) -> list[dict[str, Any]]:
    renderers = [renderer for renderer in installed(scene) if only(renderer)]
    references: dict[str, Reference] = {}
    for renderer in renderers:
        if scene in MOVING:
            references[renderer.peer] = reference(RENDERERS[0], scene)
        elif renderer.peer not in references:  # its first variant makes it
            references[renderer.peer] = reference(renderer, scene)
    measured: dict[str, list[dict[str, Any]]] = {renderer.name: [] for renderer in renderers}
    best: dict[str, list[Pixels]] = {renderer.name: [] for renderer in renderers}  # of most samples, by round
    with tempfile.TemporaryDirectory() as folder:
        for k in range(rounds):
            for renderer in renderers if k % 2 == 0 else renderers[::-1]:
                pictures = [(samples, 1000 * k + samples) for samples in ladder]
                first, *rest = run(renderer, scene, pictures, Path(folder), limit_s)
                for picture in rest:
                    pixels = load(picture.pop("path"))
                    picture["relmse"] = relmse(pixels, references[renderer.peer])
                    picture["trimmed"] = trimmed_relmse(pixels, _clean(references, renderer.peer))
                    picture["mean"] = float(pixels.mean() / references[renderer.peer].pixels.mean() - 1)
                best[renderer.name].append(pixels)
                measured[renderer.name].append(_rounded({"first": first, "pictures": rest}))
    return [
        {
            "renderer": renderer.name,
            "scene": scene,
            "digest": digest(scene),
            "resolution": facts(scene)["resolution"],
            "depth": facts(scene)["depth"],
            "reference": _rounded(
                {
                    "samples": references[renderer.peer].samples,
                    "noise": references[renderer.peer].noise,
                    "apart_from_ours": agreement(
                        _own(references[renderer.peer], scene, renderer, best[renderer.name]), references[OURS]
                    ),
                }
            ),
            "rounds": measured[renderer.name],
        }
        for renderer in renderers
    ] + [{"renderer": r.name, "scene": scene, "left_out": why} for r in meant_for(scene) if (why := _left_out(r, scene))]


def _clean(references: dict[str, Reference], peer: str) -> Reference:
    """The peer's converged picture or, where that has rare bright pixels of its own, ours: else what it has hardly found yet
    would not be missed."""
    return references[peer] if references[peer].noise < MOST_NOISE else references.get(OURS, references[peer])


def _own(reference: Reference, scene: str, renderer: Renderer, best: list[Pixels]) -> Reference:
    """The peer's converged picture; where all are held against ours, the mean of its best pictures of the rounds."""
    if scene not in MOVING or renderer.peer == OURS:
        return reference
    return reference_of(best if len(best) > 1 else 2 * best, 1)


def _left_out(renderer: Renderer, scene: str) -> str | None:
    why = reason_against(renderer, scene)
    return why or (None if renderer in installed(scene) else "not installed")


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


def medians(row: dict[str, Any], error: str = "relmse") -> list[tuple[int, float, float]]:
    """Samples, seconds and relMSE, or its "trimmed" one, of a renderer: the median over the rounds."""
    by_samples: dict[int, list[dict[str, Any]]] = {}
    for each in row["rounds"]:
        for picture in each["pictures"]:
            by_samples.setdefault(picture["samples"], []).append(picture)
    return [
        (samples, statistics.median(p["seconds"] for p in found), statistics.median(p[error] for p in found))
        for samples, found in sorted(by_samples.items())
    ]


def with_earlier(rows: list[dict[str, Any]], earlier: dict[str, Any] | None, digest: str) -> list[dict[str, Any]]:
    """In place of peers that are not installed, what was measured of them before on the same scene."""
    when = {} if earlier is None else {"date": earlier["date"], "cpu": earlier["cpu"]}
    before = {
        row["renderer"]: when | row
        for row in (earlier["rows"] if earlier else ())
        if "left_out" not in row and row.get("digest", digest) == digest
    }
    return [before.get(row["renderer"], row) if row.get("left_out") == "not installed" else row for row in rows]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.curves", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="seconds for a picture")
    options = parser.parse_args()
    for scene in options.scenes:
        report(scene, options.rounds, options.limit)


def report(scene: str, rounds: int, limit_s: float) -> None:
    rows = with_earlier(measure(scene, rounds, limit_s), latest(f"curve-{scene}"), digest(scene))
    path = write_results(f"curve-{scene}", rows)
    for row in rows:
        if "left_out" in row:
            continue
        first = statistics.median(each["first"]["process_s"] for each in row["rounds"])
        curve = "  ".join(f"{samples}: {seconds:.2f} s {error:.5f}" for samples, seconds, error in medians(row))
        print(f"{scene:7} {row['renderer']:26} first {first:5.2f} s  {curve}", flush=True)
    print(f"written: {path.name}", flush=True)


if __name__ == "__main__":
    main()
