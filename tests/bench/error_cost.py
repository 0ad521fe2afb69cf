"""What measuring the error costs, and what adaptive sampling gains: python -m tests.bench.error_cost [--spp N].

Cost: CPU seconds of a render that measures its error on the way, against one pass of the same samples that does not, by turns.
Gain: error times CPU seconds, uniform against adaptive, at the same mean number of samples; the error is the estimated one.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import replace
from typing import Any

from tests.bench.cores.replay import build

from primray import core
from primray.sampling.sampling import Sampling
from primray.settings import RenderSettings

from .results import write_results
from .scenes import BenchScene, available


def _cpu(work: Any) -> tuple[float, Any]:
    start = time.process_time()
    made = work()
    return time.process_time() - start, made


def _sampled(scene: core.CoreScene, settings: RenderSettings) -> Sampling:
    sampling = Sampling.begin(scene, settings)
    sampling.run()
    return sampling


def measure(bench: BenchScene, spp: int, repetitions: int) -> dict[str, Any]:
    scene, settings = build(bench, spp)
    settings = replace(settings, threads=None)
    # What a process pays once (OpenColorIO's configuration) before the clock runs.
    _sampled(scene, replace(settings, spp=2))
    shares, gains, samples = [], [], []
    for _ in range(repetitions):
        plain, _film = _cpu(lambda: core.render(scene, settings))
        measured, uniform = _cpu(lambda: _sampled(scene, settings))
        adapting, adapted = _cpu(lambda: _sampled(scene, replace(settings, adaptive=True)))
        shares.append(measured / plain - 1)
        error = [s.rows[-1].error.relmse.value for s in (uniform, adapted)]
        gains.append(error[0] * measured / (error[1] * adapting))
        samples.append([s.mean_samples() for s in (uniform, adapted)])
    return {
        "scene": bench.name,
        "spp": spp,
        "pixels": bench.resolution[0] * bench.resolution[1],
        "measurements": len(uniform.rows),
        "cost_median": round(statistics.median(shares), 4),
        "cost_range": [round(min(shares), 4), round(max(shares), 4)],
        "adaptive_gain_median": round(statistics.median(gains), 3),
        "adaptive_gain_range": [round(min(gains), 3), round(max(gains), 3)],
        "mean_samples": samples[-1],
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.error_cost", description=__doc__)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repetitions", type=int, default=3)
    options = parser.parse_args()
    rows = []
    for scene in available():
        row = measure(scene, options.spp, options.repetitions)
        rows.append(row)
        print(f"{row['scene']:10} measuring costs {row['cost_median']:+.3f} {row['cost_range']}, ", end="")
        print(f"adaptive gains {row['adaptive_gain_median']:.2f} {row['adaptive_gain_range']}", flush=True)
    write_results("error_cost", rows)


if __name__ == "__main__":
    main()
