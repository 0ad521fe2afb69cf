"""Self-contained HTML page of the failed picture comparisons of a test run.

It is made from the evidence that ImageCheck keeps: reference.exr, render.exr, difference.png and report.json of each.
"""

from __future__ import annotations

import base64
import json
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Floats
from ..errors import PrimrayError
from ..images.exposure import View, exposure_that_serves
from ..images.image import encode, write_png, write_text
from ..images.reading import MeasuredImage, read_measured, space_of
from ..version import __version__
from .difference import difference
from .flip import Flip, flip, has_flip

MOST_PIXELS = 1600  # pixels across; larger pictures are averaged down
NOISE_CAPTION = "difference in units of noise: blue darker, red brighter; yellow frames: changed tiles"
FULL_DIFFERENCE = 0.5  # relative difference of the map's brightest colour
Bytes = npt.NDArray[np.uint8]

STYLE = """
:root { color-scheme: light dark; --paper: #fafafa; --ink: #1c1c1e; --faint: #6a6a70; --rule: #d8d8dc; --card: #fff;
  --changed: #b3261e; --undecided: #7a5d00; }
@media (prefers-color-scheme: dark) { :root { --paper: #161618; --ink: #ececef; --faint: #a0a0a8; --rule: #3a3a40;
  --card: #202024; --changed: #ff8a80; --undecided: #ffd54f; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem; max-width: 100rem; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.05rem; margin: 0 0 .25rem; overflow-wrap: anywhere; }
nav ol { padding-left: 1.5rem; } a { color: inherit; }
section { background: var(--card); border: 1px solid var(--rule); border-radius: 8px; padding: 1rem; margin: 1.25rem 0; }
.changed { color: var(--changed); } .undecided { color: var(--undecided); } .faint { color: var(--faint); }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; margin: .5rem 0; }
dt { color: var(--faint); } dd { margin: 0; overflow-wrap: anywhere; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: .85rem; margin: .5rem 0 1rem; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(20rem, 100%), 1fr)); gap: 1rem; }
figure { margin: 0; } figcaption { color: var(--faint); font-size: .85rem; }
figure img { display: block; width: 100%; height: auto; image-rendering: pixelated; background: #000; }
.over { position: relative; } .over img + img { position: absolute; inset: 0; opacity: 0; }
.over:hover img + img, .over:focus img + img { opacity: 1; }
.over:focus { outline: 2px solid var(--faint); outline-offset: 2px; }
"""
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


@dataclass(frozen=True)
class Failure:
    """A failed comparison of a test, with its HTML."""

    test: str
    verdict: str
    reference: str
    html: str


def failure_of(test: str, evidence: Path) -> Failure:
    """Return the page's entry for an evidence folder; missing or damaged evidence is mentioned instead."""
    try:
        facts = json.loads((evidence / "report.json").read_text(encoding="utf-8"))
        shown = _pictures(evidence)
    except (OSError, ValueError, PrimrayError) as error:
        return Failure(
            test,
            "unknown",
            evidence.name,
            f"<p>The evidence in {escape(str(evidence))} cannot be shown: {escape(str(error))}</p>",
        )
    figures, seen = shown
    words = "\n".join(facts.get("words", [])[1:])
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in _facts(facts, seen, evidence))
    html = f"<dl>{rows}</dl><pre>{escape(words)}</pre><div class=pictures>{figures}</div>"
    return Failure(test, facts["verdict"], Path(facts["a"]).name, html)


def _facts(facts: dict[str, Any], seen: Flip | None, evidence: Path) -> Iterable[tuple[str, str]]:
    samples = facts["samples_per_pixel"]
    yield (
        "mean difference",
        f"{100 * facts['relative_mean_difference']:+.3g} % ± {_percent(facts['relative_mean_difference_error'])}",
    )
    yield "tolerance, false alarms", f"{_percent(facts['tolerance'])}, {facts['alpha']:g}"
    yield "tiles", ", ".join(f"{count} {verdict}" for verdict, count in facts["count"].items() if count)
    yield (
        "samples a pixel",
        " and ".join(f"{name}: {n:g}" for name, n in (("reference", samples["a"]), ("picture", samples["b"])) if n),
    )
    if seen is not None:
        yield "FLIP", f"mean {seen.mean:.4f}, largest {seen.errors.max():.3f}"
    for name, aov in facts.get("aovs", {}).items():
        yield (
            f"AOV {name}",
            f"{aov['verdict']} ({', '.join(f'{count} {verdict}' for verdict, count in aov['count'].items() if count)})",
        )
    yield "evidence", str(evidence)


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _pictures(evidence: Path) -> tuple[str, Flip | None]:
    """Return the figures of a comparison, and FLIP if the package is installed."""
    shown = next(evidence.glob("reference.*"), evidence / "reference.exr")
    if shown.suffix != ".exr":
        return _views(evidence, shown.suffix), None
    reference, made = read_measured(shown), read_measured(evidence / "render.exr")
    before, after = _shown(reference, made)
    seen = flip(reference, made) if has_flip() else None
    figures = [
        figure("reference", [before]),
        figure("picture; the reference while it is pointed at", [after, before]),
        figure(NOISE_CAPTION, [_file(evidence / "difference.png")]),
        figure(
            f"relative difference, white {FULL_DIFFERENCE:.0%} and more",
            [png(heat(_relative(reference, made) / FULL_DIFFERENCE))],
        ),
    ]
    if seen is not None:
        figures.append(figure("FLIP, white 1", [png(heat(seen.errors))]))
    return "".join(figures), seen


def _views(evidence: Path, suffix: str) -> str:
    """Return the figures of a comparison of display pictures, which are shown unchanged."""
    reference, made = (read_measured(next(evidence.glob(f"{name}{suffix}"))) for name in ("reference", "render"))
    before, after = (png((np.clip(i.pixels, 0, 1) * 255 + 0.5).astype(np.uint8)) for i in (reference, made))
    return "".join(
        [
            figure("reference", [before]),
            figure("picture; the reference while it is pointed at", [after, before]),
            figure(NOISE_CAPTION, [_file(evidence / "difference.png")]),
        ]
    )


def _shown(reference: MeasuredImage, made: MeasuredImage) -> tuple[str, str]:
    """Return both pictures at the automatic exposure of the reference."""
    space = space_of(reference.chromaticities)
    whole = [np.concatenate([i.pixels, np.ones((*i.pixels.shape[:2], 1), np.float32)], axis=2) for i in (reference, made)]
    stops = exposure_that_serves(whole[0], View(space=space))
    before, after = (png(encode(pixels, exposure=stops, space=space)) for pixels in whole)
    return before, after


def _relative(reference: MeasuredImage, made: MeasuredImage) -> Floats:
    """Return the largest channel's difference (H, W) relative to the brightness, as in comparisons."""
    of = difference(reference, made)
    level = np.abs(of.mean[:3]).mean(axis=0) + of.floor
    size = np.abs(of.d[:3]).max(axis=0)
    found: Floats = np.divide(size, level, out=np.zeros_like(size), where=level > 0).astype(np.float32)
    return found


def heat(values: Floats) -> Bytes:
    """Return colours (H, W, 3) from black over red and yellow to white for values in 0 to 1."""
    share = np.clip(np.nan_to_num(values), 0, 1)[..., None] * 3
    made: Bytes = (np.clip(share - np.arange(3), 0, 1) * 255 + 0.5).astype(np.uint8)
    return made


def figure(caption: str, images: Sequence[str]) -> str:
    tags = "".join(f'<img alt="{escape(caption)}" src="{source}">' for source in images)
    over = f"<div class=over tabindex=0>{tags}</div>" if len(images) > 1 else tags
    return f"<figure>{over}<figcaption>{escape(caption)}</figcaption></figure>"


def png(pixels: Bytes) -> str:
    step = -(-max(pixels.shape[:2]) // MOST_PIXELS)
    if step > 1:
        height, width = (size // step for size in pixels.shape[:2])
        blocks = pixels[: height * step, : width * step].reshape(height, step, width, step, -1)
        pixels = blocks.mean(axis=(1, 3)).astype(np.uint8)
    with tempfile.TemporaryDirectory() as folder:
        return _file(write_png(np.ascontiguousarray(pixels), Path(folder, "a.png")))


def _file(png: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(png.read_bytes()).decode()}"


def write_page(failures: Sequence[Failure], path: Path) -> None:
    """Write the page atomically; it says so if there are no failures."""
    count = len(failures)
    title = f"{count} failed comparison{'' if count == 1 else 's'} of pictures" if count else "No comparison of pictures failed"
    links = "".join(
        f'<li><a href="#f{n}">{escape(f.test)}</a> <span class="{f.verdict}">{f.verdict}</span></li>'
        for n, f in enumerate(failures)
    )
    sections = "".join(
        f'<section id="f{n}"><h2>{escape(f.test)}</h2><p><strong class="{f.verdict}">{f.verdict}</strong> '
        f"<span class=faint>against {escape(f.reference)}</span></p>{f.html}</section>"
        for n, f in enumerate(failures)
    )
    write_text(
        path,
        f'<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name=viewport content="width=device-width"><title>{title}</title><style>{STYLE}</style>'
        f"<h1>{title}</h1><nav><ol>{links}</ol></nav>{sections}<p class=faint>primray {__version__}</p></html>\n",
    )
