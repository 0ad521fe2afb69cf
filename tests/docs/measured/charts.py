"""Charts with logarithmic axes as SVG, written by hand so that the pages need no plotting library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 720, 420
LEFT, RIGHT, TOP, BOTTOM = 70, 210, 34, 50  # margins; names of the lines stand in the right one
# Okabe and Ito 2008, "Color Universal Design": told apart by colour-blind eyes.
COLORS = ("#d55e00", "#0072b2", "#56b4e9", "#009e73", "#cc79a7", "#e69f00", "#555555", "#000000")


@dataclass(frozen=True)
class Line:
    name: str
    points: Sequence[tuple[float, float]]  # above zero
    spread: Sequence[tuple[float, float]] = ()  # lowest and highest y of each point; none: not drawn
    color: int | None = None  # of COLORS; None: by its place


class Axis:
    """Values above zero, from first to last pixel."""

    def __init__(self, values: Sequence[float], first: float, last: float) -> None:
        low, high = math.log10(min(values)), math.log10(max(values))
        room = max(0.05 * (high - low), 0.05)
        self.low, self.high, self.first, self.last = low - room, high + room, first, last

    def __call__(self, value: float) -> float:
        return self.first + (math.log10(value) - self.low) / (self.high - self.low) * (self.last - self.first)

    def ticks(self) -> list[float]:
        """Powers of ten, with 2 and 5 between them where there are few."""
        few = self.high - self.low < 3
        powers = range(math.floor(self.low), math.ceil(self.high) + 1)
        found = [m * 10.0**p for p in powers for m in ((1, 2, 5) if few else (1,))]
        return [value for value in found if self.low <= math.log10(value) <= self.high]


def chart(title: str, x_name: str, y_name: str, lines: Sequence[Line]) -> str:
    lines = [line for line in lines if line.points]
    x = Axis([p[0] for line in lines for p in line.points], LEFT, WIDTH - RIGHT)
    y = Axis([v for line in lines for p, s in _with_spread(line) for v in (p[1], *s)], HEIGHT - BOTTOM, TOP)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        text((LEFT + WIDTH - RIGHT) / 2, 18, title, "middle", size=14),
        text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, x_name, "middle"),
        f'<text transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2:.0f}) rotate(-90)" text-anchor="middle">'
        f"{escape(y_name)}</text>",
    ]
    for value in x.ticks():
        parts.append(rule(x(value), TOP, x(value), HEIGHT - BOTTOM))
        parts.append(text(x(value), HEIGHT - BOTTOM + 16, _number(value), "middle"))
    for value in y.ticks():
        parts.append(rule(LEFT, y(value), WIDTH - RIGHT, y(value)))
        parts.append(text(LEFT - 6, y(value) + 4, _number(value), "end"))
    for k, line in enumerate(lines):
        parts += _drawn(line, COLORS[(k if line.color is None else line.color) % len(COLORS)], x, y, legend_y=TOP + 12 + 20 * k)
    return "\n".join([*parts, "</svg>"]) + "\n"


def _with_spread(line: Line) -> list[tuple[tuple[float, float], tuple[float, ...]]]:
    spread: Sequence[tuple[float, ...]] = line.spread or [()] * len(line.points)
    return list(zip(line.points, spread, strict=True))


def _drawn(line: Line, color: str, x: Axis, y: Axis, legend_y: float) -> list[str]:
    points = sorted(_with_spread(line))
    path = " ".join(f"{x(px):.1f},{y(py):.1f}" for (px, py), _ in points)
    parts = [f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"/>']
    for (px, py), spread in points:
        parts.append(f'<circle cx="{x(px):.1f}" cy="{y(py):.1f}" r="3.5" fill="{color}"/>')
        if spread:
            parts.append(f'<path d="M{x(px):.1f} {y(spread[0]):.1f}V{y(spread[1]):.1f}" stroke="{color}"/>')
    at = WIDTH - RIGHT + 12
    parts.append(f'<path d="M{at} {legend_y}h18" stroke="{color}" stroke-width="2"/>')
    return [*parts, text(at + 24, legend_y + 4, line.name, "start")]


def rule(x0: float, y0: float, x1: float, y1: float) -> str:
    """Return a grey line."""
    return f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="#ddd"/>'


def text(x: float, y: float, words: str, anchor: str, size: int = 12) -> str:
    """Return a line of text; `anchor`: start, middle or end."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}">{escape(words)}</text>'


def _number(value: float) -> str:
    """1000000 as 1e6, 0.00001 as 1e-5, what lies between as it is."""
    if 1e-4 <= value < 1e4:
        return f"{value:g}"
    mantissa, _, exponent = f"{value:.0e}".partition("e")
    return f"{mantissa}e{int(exponent)}"
