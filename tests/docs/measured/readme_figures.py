"""README.md's figures, from tests/bench/results. `python -m tests.docs.measured.readme_figures` rewrites them."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Collection
from pathlib import Path

from tests.bench.peers.scenes import SCENES
from tests.bench.results import latest
from tests.statistics.errors.calibration import ROUGH

from .benchmark_tables import leads_of, spread, table

ROOT = Path(__file__).resolve().parents[3]
README = ROOT / "README.md"
BEGIN = "<!-- generated from tests/bench/results by `make docs`: begin -->"
END = "<!-- generated: end -->"
NAMES = {"cycles": "Cycles", "luxcore": "LuxCore", "mitsuba": "Mitsuba, the faster of its variants"}
COVERAGE = json.loads((ROOT / "tests/bench/results/error-coverage.json").read_text(encoding="utf-8"))["cells"]


def times_as_long() -> dict[str, list[float]]:
    """By peer, for each scene that it was measured on: seconds of its best variant to the scene's target, over primray's; or
    the lead without the worst pixels, where that is less."""
    found = defaultdict(list)
    for scene in SCENES:
        kept = latest(f"curve-{scene}")
        if kept is None:
            continue
        ratios = defaultdict(list)
        for ratio, renderer in leads_of(scene, kept["rows"]):
            ratios[renderer.partition("-")[0]].append(ratio)
        for peer, theirs in ratios.items():
            found[peer].append(min(theirs))
    return dict(sorted(found.items()))


def coverage(names: Collection[str]) -> str:
    """How often the interval held the true error of these stages."""
    cells = [cell for name in names for cell in COVERAGE[name]]
    share = sum(cell["coverage"] for cell in cells) / len(cells)
    return f"{100 * share:.0f} % of {sum(cell['renders'] for cell in cells):,} renders of {len(names)} stages"


def figures() -> str:
    """Markdown: how often the interval is right, and how long others take to the same error."""
    usual = coverage(COVERAGE.keys() - set(ROUGH))
    rows = [(NAMES[peer], str(len(times)), spread(times, 1)) for peer, times in times_as_long().items()]
    return (
        f"The 95 % interval held the true error in {usual},\nand in {coverage(ROUGH)} with small bright lights in view.\n\n"
        "Seconds to the same error, over primray's:\n\n" + table(("renderer", "scenes", "median (range)"), rows)
    )


def with_figures(readme: str) -> str:
    """README.md with the figures between their marks made new."""
    before, _, rest = readme.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{figures()}\n{END}{after}"


if __name__ == "__main__":
    README.write_text(with_figures(README.read_text(encoding="utf-8")), encoding="utf-8")
