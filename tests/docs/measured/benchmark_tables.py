"""What docs/benchmarks.md says of each kind of measurement: from the raw rows to tables, and sentences on where we lose."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tests.bench.curves import medians
from tests.bench.efficiency import ratios
from tests.bench.figures.fits import Growth, growth, power_of_n_log_n, time_to
from tests.bench.growth import ray_us, setup_cpu_s, setup_s

Rows = Sequence[dict[str, Any]]
OURS = "primray"
# The error that times are told for: within what every renderer reaches in some seconds.
TARGETS = {
    "box": 0.002,
    "field": 0.003,
    "hills": 0.002,
    "metals": 0.02,
    "haze": 0.02,
    "lamps": 0.05,
    "cove": 0.05,
    "window": 0.3,
    "showroom": 0.05,
    "plastics": 0.005,
    "shelf": 0.01,
    "flesh": 0.005,
    "groom": 0.005,
    "pelt": 0.005,
    "signs": 0.05,
    "studio": 0.01,
    "pool": 0.1,
    "bulbs": 0.1,
    "junk": 0.05,
    "ajar": 0.05,
    "attic": 0.05,
    "arcade": 0.002,
    "spin": 0.02,
    "pan": 0.005,
    "swarm": 0.01,
    "flag": 0.002,
}
# Of the best other renderer, in time to that error.
AHEAD = {
    "box": 1.3,
    "field": 3.0,
    "hills": 2.0,
    "metals": 3.0,
    "haze": 3.0,
    "lamps": 20.0,
    "cove": 2.0,
    "window": 2.0,
    "showroom": 2.0,
    "plastics": 2.0,
    "shelf": 2.0,
    "flesh": 2.0,
    "groom": 2.0,
    "pelt": 2.0,
    "signs": 2.0,
    "studio": 2.0,
    "pool": 5.0,
    "bulbs": 5.0,
    "junk": 2.0,
    "ajar": 6.0,
    "attic": 4.0,
    "arcade": 2.0,
    "spin": 3.0,
    "pan": 3.0,
    "swarm": 3.0,
    "flag": 3.0,
}
SHARES = {16: 0.8, 8: 0.75}  # of Embree's, that the render's speed should have
SPEED_UP = 1.9  # with two threads
GROWTH_ROOM = 0.1  # by which a fitted power may exceed that of n log n


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def volumes_table(rows: Rows) -> str:
    """Errors and seconds of pictures with volumes, and their products over ours with the most samples."""
    ours = {row["scene"]: _error_seconds(row) for row in rows if row["renderer"] == "primray"}
    head = ("scene", "renderer", "samples", "relMSE", "s", "relMSE x s, x ours", "mean")
    lines = []
    for row in rows:
        within = f"within {row['mean_within']:.2%}" if "mean_within" in row else ""
        off = f"{row['mean_off']:+.3%}" if row.get("mean_off") else within
        seconds = f"{row.get('s', row.get('cpu_s')):.2f}"
        product = f"{_error_seconds(row) / ours[row['scene']]:.1f}"
        lines.append(
            (row["scene"], row["renderer"], str(row.get("samples", "")), f"{row['relmse']:.2g}", seconds, product, off)
        )
    return table(head, lines)


def _error_seconds(row: Mapping[str, Any]) -> float:
    return float(row["relmse"]) * float(row["s"] if "s" in row else row["cpu_s"])


def spread(values: Sequence[float], digits: int = 2) -> str:
    """The median and, of several, the range."""
    middle = f"{statistics.median(values):.{digits}f}"
    return middle if len(values) < 2 else f"{middle} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def measured(rows: Rows) -> list[dict[str, Any]]:
    return [row for row in rows if "left_out" not in row]


def seconds_to(row: dict[str, Any], error: float) -> tuple[float, bool] | None:
    found = time_to([(seconds, relmse) for _, seconds, relmse in medians(row)], error)
    return None if found is None else (found.seconds, found.extrapolated)


def curve_table(scene: str, rows: Rows) -> str:
    target = TARGETS[scene]
    width, height = measured(rows)[0]["resolution"]
    ours = seconds_to(next(row for row in rows if row["renderer"] == OURS), target)
    is_trimmed = has_trimmed(rows)
    lines = []
    for row in measured(rows):
        curve = medians(row)
        samples, seconds, error = curve[-1]
        found = seconds_to(row, target)
        mean = statistics.median(r["pictures"][-1]["mean"] for r in row["rounds"])
        speeds = [p["samples"] * width * height / p["seconds"] / 1e6 for r in row["rounds"] for p in r["pictures"][-1:]]
        lines.append(
            (
                f"{row['renderer']} ({row['date']})" if "date" in row else row["renderer"],
                spread(speeds),
                str(samples),
                f"{error:.5f}",
                f"{1 / (error * seconds):.3g}" if error > 0 else "",
                *([f"{each:.3g}" if (each := trimmed_efficiency(row)) else ""] if is_trimmed else []),
                _told(found),
                f"{found[0] / ours[0]:.2f}" if found and ours else "",
                f"{100 * mean:+.2f} %",
                f"{100 * row['reference']['apart_from_ours']['blocks']:.2f} %",
            )
        )
    head = ["renderer", "Msamples/s", "samples", "relMSE", "1 / (relMSE s)", f"s to {target:g}", "x ours", "mean", "apart"]
    if is_trimmed:
        head.insert(5, "without 1 %")
    return table(head, lines)


def _told(found: tuple[float, bool] | None) -> str:
    return "" if found is None else f"{'~' if found[1] else ''}{found[0]:.2f}"


def efficiency_table(rows: Rows) -> str:
    lines = []
    for row in rows:
        [(_, seconds, error)] = medians(row)
        [ours] = [each for each in rows if each["renderer"] == OURS and each["scene"] == row["scene"]]
        ahead = "" if row is ours else spread(ratios(ours, row))
        mean = statistics.median(r["pictures"][0]["mean"] for r in row["rounds"])
        told = f"{1 / (error * seconds):.4g}"
        lines.append((row["scene"], row["renderer"], f"{seconds:.2f}", f"{error:.3g}", told, ahead, f"{100 * mean:+.2f} %"))
    return table(("scene", "renderer", "s", "relMSE", "1 / (relMSE s)", "ours over it", "mean"), lines)


def efficiency_lost(rows: Rows) -> Iterator[str]:
    for scene in dict.fromkeys(row["scene"] for row in rows):
        ours, *others = sorted((row for row in rows if row["scene"] == scene), key=lambda row: row["renderer"] != OURS)
        ahead, name = min((statistics.median(ratios(ours, row)), row["renderer"]) for row in others)
        if ahead < AHEAD[scene]:
            yield f"{scene}: at 64 samples each ours is {ahead:.2f} times as efficient as {name}, {AHEAD[scene]:g} is aimed at"


def times_to_target(scene: str, rows: Rows) -> tuple[float | None, list[tuple[float, str]]]:
    """Return our seconds to the scene's error, and those of each other renderer that gets there, with its name."""
    times = {row["renderer"]: found[0] for row in measured(rows) if (found := seconds_to(row, TARGETS[scene]))}
    own = times.pop(OURS, None)
    return own, [(seconds, name) for name, seconds in times.items()]


def has_trimmed(rows: Rows) -> bool:
    """Return whether errors without the worst pixels were measured, which came later than the others."""
    return all("trimmed" in p for row in measured(rows) for r in row["rounds"] for p in r["pictures"])


def trimmed_efficiency(row: dict[str, Any]) -> float | None:
    """Return 1 / (error x seconds) of the picture of most samples, without the worst hundredth of its pixels."""
    _, seconds, error = medians(row, "trimmed")[-1]
    return 1 / (error * seconds) if error > 0 else None


def trimmed_leads(rows: Rows) -> dict[str, float]:
    """Return our efficiency without the worst pixels over that of each other renderer; empty where it was not measured."""
    if not has_trimmed(rows):
        return {}
    found = {row["renderer"]: trimmed_efficiency(row) for row in measured(rows)}
    own = found.pop(OURS, None)
    return {name: own / each for name, each in found.items() if own and each}


def trimmed_lead(rows: Rows) -> tuple[float, str] | None:
    """Return the least of these, and that renderer's name."""
    return min(((ratio, name) for name, ratio in trimmed_leads(rows).items()), default=None)


def leads_of(scene: str, rows: Rows) -> list[tuple[float, str]]:
    """Return how many times our seconds to the scene's error each other renderer takes; where that is less, the lead without
    the worst pixels: where rare bright paths rule an error, it is that of a few pixels."""
    own, others = times_to_target(scene, rows)
    trimmed = trimmed_leads(rows)
    return [] if own is None else [(min(seconds / own, trimmed.get(name, seconds / own)), name) for seconds, name in others]


def curves_lost(scene: str, rows: Rows) -> Iterator[str]:
    [ours] = [row for row in rows if row["renderer"] == OURS]
    target, (own, others) = TARGETS[scene], times_to_target(scene, rows)
    if own is not None and others:
        for seconds, name in sorted(others):
            if seconds < own:
                yield f"{scene}: {name} reaches a relMSE of {target:g} in {seconds:.2f} s, ours in {own:.2f} s"
        seconds, name = min(others)
        if own <= seconds < AHEAD[scene] * own:
            ratio = f"{seconds / own:.2f} times as fast as {name}"
            yield f"{scene}: to a relMSE of {target:g} ours is {ratio}, {AHEAD[scene]:g} times is aimed at"
    if (lead := trimmed_lead(rows)) is not None and lead[0] < AHEAD[scene]:
        ratio = f"{lead[0]:.2f} times as efficient as {lead[1]}"
        yield f"{scene}: without the worst hundredth of the pixels ours is {ratio}, {AHEAD[scene]:g} times is aimed at"
    for what, unit in (("process_s", "s to a first picture"), ("peak_mb", "MB of memory")):
        best = min(measured(rows), key=lambda row: _median(row, what))
        if best is not ours and _median(best, what) < _median(ours, what):
            yield f"{scene}: {best['renderer']} takes {_median(best, what):.4g} {unit}, ours {_median(ours, what):.4g}"


def _median(row: dict[str, Any], what: str) -> float:
    if what == "peak_mb":
        return float(statistics.median(r["pictures"][-1]["peak_mb"] for r in row["rounds"]))
    return float(statistics.median(first[what] for first in firsts(row)))


def firsts(row: dict[str, Any]) -> Rows:
    """First pictures: those that were made by turns, where they were, or else those of a curve."""
    return row.get("firsts") or [r["first"] for r in row["rounds"]]


def first_table(scenes: dict[str, Rows]) -> str:
    lines = []
    for scene, rows in scenes.items():
        for row in measured(rows):
            found = firsts(row)
            stages = {name: statistics.median(f["stages_s"][name] for f in found) for name in found[0]["stages_s"]}
            told = ", ".join(f"{name} {seconds:.2f}" for name, seconds in stages.items() if seconds >= 0.005)
            whole = spread([f["process_s"] for f in found])
            lines.append((scene, row["renderer"], whole, told, f"{_median(row, 'peak_mb'):.0f}"))
    return table(("scene", "renderer", "s to a first picture", "of which, s", "peak MB"), lines)


def replay_table(rows: Rows) -> str:
    lines = []
    for row in rows:
        low, high = row["embree_share_range"]
        share = f"{row['embree_share_median']:.3f} ({low:.3f} to {high:.3f})"
        rate = row["rays"] / statistics.median(row["render_s"]) / 1e6
        occupancy = f"{row['lane_occupancy']:.3f}"
        lines.append((row["scene"], str(row["lanes"]), share, f"{rate:.2f}", f"{row['rays'] / row['samples']:.2f}", occupancy))
    return table(("scene", "lanes", "Embree's share", "Mrays/s, 1 thread", "rays a sample", "lanes full"), lines)


def replay_lost(rows: Rows) -> Iterator[str]:
    for row in rows:
        wanted = SHARES.get(row["lanes"])
        if wanted is not None and row["embree_share_median"] < wanted:
            share, lanes = row["embree_share_median"], row["lanes"]
            yield f"{row['scene']}: {share:.0%} of Embree's speed on its own rays at {lanes} lanes ({wanted:.0%} aimed at)"


def of_kind(rows: Rows, kind: str) -> list[dict[str, Any]]:
    return sorted((row for row in rows if row["kind"] == kind), key=lambda row: row["count"])


def fitted(rows: Rows, kind: str, cost: Any) -> Growth | None:
    points = [(row["count"], cost(row)) for row in of_kind(rows, kind)]
    points = [(count, value) for count, value in points if value > 0]
    return growth([p[0] for p in points], [p[1] for p in points]) if len(points) >= 4 else None


def growth_table(rows: Rows) -> str:
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        found = of_kind(rows, kind)
        first, last = found[0], found[-1]
        setup, rays = fitted(rows, kind, setup_cpu_s), fitted(rows, kind, ray_us)
        lines.append(
            (
                kind,
                f"{first['count']:,} to {last['count']:,}",
                f"{setup_s(last):.2f}",
                f"{setup_cpu_s(last):.2f}",
                f"{setup_cpu_s(last) / last['count'] * 1e6:.3g}",
                f"{setup.power:.2f} (± {setup.residual:.0%})" if setup else "",
                f"{power_of_n_log_n([row['count'] for row in found]):.2f}",
                f"{ray_us(first):.3f} to {ray_us(last):.3f}",
                f"{rays.power:.2f}" if rays else "",
                f"{last['peak_bytes'] / 2**20:.0f}",
                f"{last['bytes_per_item']:.0f}",
                f"{first['timed_relmse'] * first['timed_s']:.2g} to {last['timed_relmse'] * last['timed_s']:.2g}",
            )
        )
    head = (
        "kind",
        "items",
        "set-up, s",
        "CPU s",
        "us each",
        "power",
        "of n log n",
        "us a ray",
        "power",
        "peak MB",
        "bytes each",
        "relMSE x s",
    )
    return table(head, lines)


def growth_lost(rows: Rows) -> Iterator[str]:
    for kind in dict.fromkeys(row["kind"] for row in rows):
        setup = fitted(rows, kind, setup_cpu_s)
        bound = power_of_n_log_n([row["count"] for row in of_kind(rows, kind)])
        if setup is not None and setup.power > bound + GROWTH_ROOM:
            yield f"set-up of {kind} grows by the power {setup.power:.2f} of their number; n log n is {bound:.2f}"


def pictures_table(rows: Rows) -> str:
    lines = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        its = [row for row in rows if row["scene"] == scene]
        cells = [scene]
        for kind in ("pixels", "samples"):
            found = fitted(its, kind, lambda row: statistics.median(row["seconds"]))
            cells.append(f"{found.power:.2f} (± {found.residual:.0%})" if found else "")
        cells.append(", ".join(f"{threads}: {ratio:.2f}" for threads, ratio in speed_ups(its).items()))
        cells.append(", ".join(f"{threads}: {busy:.2f}, {work:.3f}" for threads, (busy, work) in work_of_threads(its).items()))
        lines.append(tuple(cells))
    head = ("scene", "power of pixels", "power of samples", "speed-up by threads", "cores that they had, CPU x one thread's")
    return table(head, lines)


def work_of_threads(rows: Rows) -> dict[int, tuple[float, float]]:
    """By number of threads: how many cores they had while they ran, and their CPU seconds over one thread's. Where fewer cores
    than threads were had, others had them, and the speed-up says little."""
    found = {row["count"]: row for row in of_kind(rows, "threads") if "cpu_s" in row}
    return {
        threads: (
            statistics.median(cpu / seconds for cpu, seconds in zip(row["cpu_s"], row["seconds"], strict=True)),
            statistics.median(many / one for one, many in zip(found[1]["cpu_s"], row["cpu_s"], strict=True)),
        )
        for threads, row in found.items()
        if threads > 1
    }


def speed_ups(rows: Rows) -> dict[int, float]:
    """Medians of the rounds' ratios to one thread, by number of threads."""
    by_threads = {row["count"]: row["seconds"] for row in of_kind(rows, "threads")}
    return {
        threads: statistics.median(one / many for one, many in zip(by_threads[1], seconds, strict=True))
        for threads, seconds in by_threads.items()
        if threads > 1
    }


def pictures_lost(rows: Rows) -> Iterator[str]:
    for scene in dict.fromkeys(row["scene"] for row in rows):
        its = [row for row in rows if row["scene"] == scene]
        ratio, had = speed_ups(its).get(2), work_of_threads(its).get(2)
        if ratio is not None and ratio < SPEED_UP:
            cores = f", with {had[0]:.2f} cores to themselves" if had is not None else ""
            yield f"{scene}: two threads are {ratio:.2f} times as fast as one ({SPEED_UP} aimed at){cores}"


def ablation_table(rows: Rows) -> str:
    lines = [
        (
            row["name"],
            row["instead"],
            row["scene"],
            f"{row['error']:.3f}",
            f"{row['seconds']:.3f}",
            f"{row['error_seconds']:.3f} ({row['range'][0]:.3f} to {row['range'][1]:.3f})",
            f"{row['date']}, {row['cpu']}, {row['isa']}",
        )
        for row in sorted(measured(rows), key=lambda row: row["name"])
    ]
    return table(("without", "instead", "scene", "error x", "seconds x", "both x", "measured"), lines)


def ablations_lost(rows: Rows) -> Iterator[str]:
    for row in measured(rows):
        if row["range"][1] < 1:
            yield f"{row['scene']}: better without {row['name']} ({row['instead']}): error x seconds {row['error_seconds']:.3f}"


def island_table(rows: Rows) -> str:
    """Return the table of islands: seconds of each step and the peak of memory."""
    steps = ("open", "translate", "build", "render")
    head = ("instances", "triangles", *steps[:3], "first picture", "in all", "peak, GB")
    return table(
        head,
        [
            (
                f"{row['instances']:,}",
                f"{row['triangles']:,}",
                *(f"{row[f'{step}_s']:.2f} ({row[f'{step}_cpu_s']:.2f})" for step in steps),
                f"{sum(row[f'{step}_s'] for step in steps):.1f} ({sum(row[f'{step}_cpu_s'] for step in steps):.1f})",
                f"{row['peak_bytes'] / 1e9:.1f}",
            )
            for row in rows
        ],
    )
