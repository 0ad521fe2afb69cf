"""What docs/benchmarks.md says of rays that have times: from the raw rows to a table, and sentences on where we lose."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from .benchmark_tables import table

Rows = Sequence[dict[str, Any]]
WANTED = 0.85  # of Embree's rate
KINDS = {"terrain": "triangles whose vertices move", "instances": "instances, straight between times", "turning": "that turn"}


def rates_table(rows: Rows) -> str:
    lines = []
    for row in rows:
        low, high = row["rate_range"]
        lines.append(
            (
                f"{row['count']:,} {KINDS[row['kind']]}",
                str(row["times"]),
                "shadow rays" if row["shadow"] else "nearest hits",
                row["entry"],
                f"{row['ours_mrays_per_s']:.2f}",
                f"{row['embree_mrays_per_s']:.2f}",
                f"{row['rate_median']:.3f} ({low:.3f} to {high:.3f})",
                f"{row['apart'] / row['rays']:.2%}",
            )
        )
    head = ("what moves", "times", "rays", "entry", "ours, Mrays/s", "Embree's", "ours over Embree's", "other hits")
    return table(head, lines)


def rates_lost(rows: Rows) -> Iterator[str]:
    """By the entry that a render has chosen."""
    for row in rows:
        if row["entry"] == "recorded" and row["rate_median"] < WANTED:
            what = f"{row['kind']} at {row['times']} times: {'shadow rays' if row['shadow'] else 'nearest hits'}"
            yield f"{what} at {row['rate_median']:.0%} of Embree's own rate ({WANTED:.0%} aimed at)"


def cpu_table(scenes: Mapping[str, Rows]) -> str:
    """At the most samples that all took: error, CPU seconds, and the products over ours."""
    lines = []
    for scene, rows in scenes.items():
        counts = [{p["samples"] for r in row["rounds"] for p in r["pictures"]} for row in rows]
        samples = max(set.intersection(*counts))
        found = {row["renderer"]: _medians(row, samples) for row in rows}
        own = found["primray"][0] * found["primray"][1]
        for name, (error, cpu_s) in found.items():
            lines.append((scene, name, str(samples), f"{error:.5f}", f"{cpu_s:.2f}", f"{error * cpu_s / own:.2f}"))
    return table(("scene", "renderer", "samples", "relMSE", "CPU s", "relMSE x CPU s, over ours"), lines)


def _medians(row: dict[str, Any], samples: int) -> tuple[float, float]:
    pictures = [p for r in row["rounds"] for p in r["pictures"] if p["samples"] == samples]
    error, cpu_s = (statistics.median(p[what] for p in pictures) for what in ("relmse", "cpu_s"))
    return error, cpu_s
