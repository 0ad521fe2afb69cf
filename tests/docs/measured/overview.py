"""The chart that docs/benchmarks.md opens with: our time to an error over the best other's, by kind of scene and by CPU."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tests.bench.results import latest
from tests.docs.measured.benchmark_tables import AHEAD, leads_of

from .charts import COLORS, Axis, rule, text

KINDS = {
    "rooms": ("box", "cove", "window", "ajar", "attic"),
    "sun and sky": ("field", "hills", "arcade", "metals", "haze"),
    "lamps": ("lamps", "showroom", "signs", "studio"),
    "surfaces": ("plastics", "shelf", "junk"),
    "glass and water": ("pool", "bulbs"),
    "hair and skin": ("groom", "pelt", "flesh"),
    "motion": ("spin", "pan", "swarm", "flag"),
}
VENDORS = ("Intel", "AMD")
WIDTH, LEFT, RIGHT, TOP, BOTTOM = 720, 190, 24, 62, 40
ROW, SPACE = 18, 10  # pixels of a scene's row, and between kinds


@dataclass(frozen=True)
class Lead:
    """How many times the time of ours the best other renderer takes to an error on a scene, by the CPU's vendor; or, where that
    is less and was measured, how many times its efficiency ours has without the worst hundredth of the pixels."""

    scene: str
    vendor: str
    ratio: float
    peer: str
    date: str


def leads() -> list[Lead]:
    """Return what was measured last of each scene on each vendor's CPUs."""
    return [lead for kind in KINDS.values() for scene in kind for vendor in VENDORS if (lead := _lead(scene, vendor))]


def _lead(scene: str, vendor: str) -> Lead | None:
    newest = latest(f"curve-{scene}", cpu=vendor)
    if newest is None:
        return None
    leads = leads_of(scene, newest["rows"])
    if not leads:
        return None
    ratio, peer = min(leads)
    return Lead(scene, vendor, ratio, peer, newest["date"])


def unmeasured(found: Sequence[Lead]) -> Iterator[str]:
    """Yield a sentence for each vendor whose CPUs have not seen some of the scenes."""
    for vendor in VENDORS:
        missing = [
            scene for kind in KINDS.values() for scene in kind if (scene, vendor) not in {(x.scene, x.vendor) for x in found}
        ]
        if missing:
            yield f"on {vendor} CPUs: {', '.join(missing)}"


def drawn(found: Sequence[Lead]) -> str:
    """Return the chart as SVG: a row for each measured scene, a mark for each vendor, the scenes of a kind together."""
    by_kind = {kind: [[x for x in found if x.scene == scene] for scene in scenes] for kind, scenes in KINDS.items()}
    by_kind = {kind: [row for row in rows if row] for kind, rows in by_kind.items()}
    by_kind = {kind: rows for kind, rows in by_kind.items() if rows}
    height = TOP + sum(ROW * len(rows) + SPACE for rows in by_kind.values()) + BOTTOM
    x = Axis([0.3, 1.0, *(lead.ratio for lead in found)], LEFT, WIDTH - RIGHT)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{height}" fill="white"/>',
        text(WIDTH / 2, 18, "times as fast to an error as the best other renderer", "middle", size=14),
    ]
    for k, vendor in enumerate(VENDORS):
        at = LEFT + 160 * k
        parts += [_mark(at + 6, 38, k), text(at + 18, 42, vendor, "start")]
    for value in x.ticks():
        parts.append(rule(x(value), TOP - 8, x(value), height - BOTTOM + 4))
        parts.append(text(x(value), height - BOTTOM + 20, f"{value:g}", "middle"))
    parts.append(f'<path d="M{x(1):.1f} {TOP - 8}V{height - BOTTOM + 4}" stroke="#000"/>')
    y = float(TOP)
    for kind, rows in by_kind.items():
        parts.append(text(8, y + ROW / 2 + 4, kind, "start"))
        for row in rows:
            middle = y + ROW / 2
            parts.append(text(LEFT - 8, middle + 4, row[0].scene, "end"))
            for lead in row:
                k = VENDORS.index(lead.vendor)
                color = COLORS[k]
                parts.append(f'<path d="M{x(1):.1f} {middle:.1f}H{x(lead.ratio):.1f}" stroke="{color}" stroke-width="2"/>')
                parts.append(_mark(x(lead.ratio), middle, k))
            y += ROW
        y += SPACE
    return "\n".join([*parts, "</svg>"]) + "\n"


def _mark(x: float, y: float, number: int) -> str:
    """Vendors differ by shape as well as by colour."""
    color = COLORS[number]
    if number == 0:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{color}"/>'
    return f'<rect x="{x - 4.5:.1f}" y="{y - 4.5:.1f}" width="9" height="9" fill="{color}"/>'


def words(found: Sequence[Lead]) -> str:
    """Return the sentence below the chart."""
    behind = sorted((lead for lead in found if lead.ratio < 1), key=lambda lead: lead.ratio)
    short = sum(1 <= lead.ratio < AHEAD[lead.scene] for lead in found)
    slower = (
        ", ".join(f"{lead.scene} ({lead.ratio:.2f} of {lead.peer}'s speed on {lead.vendor}, {lead.date})" for lead in behind)
        or "none"
    )
    scenes = len({lead.scene for lead in found})
    return (
        f"{len(found)} measurements of {scenes} scenes by the time to an error, each renderer held\n"
        f"against its own converged picture; where rare bright pixels make the ratio larger, it is the one without the worst\n"
        f"hundredth of the pixels (since 2026-11-30). Slower than the best other: {slower}.\n"
        f"Ahead, but by less than is aimed at: {short}. What was not measured is said at the end."
    )
