"""The page of `primray ci`: self-contained HTML with each stage's pictures and what each edit moves."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from ..compare.failure_page import POLICY, STYLE, Bytes, figure, heat, png
from ..images.image import Image, write_text
from ..version import __version__
from .attribution import Effect, Shot, StageResult, stops_of
from .findings import Findings

_MOST_FIGURES = 12  # pictures of edits of a stage
_TABLE = """
table { border-collapse: collapse; margin: .75rem 0; width: 100%; font-size: .9rem; }
th, td { text-align: left; padding: .2rem .6rem .2rem 0; border-bottom: 1px solid var(--rule); overflow-wrap: anywhere; }
th { color: var(--faint); font-weight: normal; }
.broken, .deleted { color: var(--changed); }
"""


def write_page(found: Findings, path: Path) -> None:
    """Write the page atomically."""
    title = f"primray ci: {found.summary}"
    listed = "".join(
        f'<li><a href="#s{n}">{escape(stage.stage)}</a> <span class="{stage.verdict}">{stage.verdict}</span></li>'
        for n, stage in enumerate(found.stages)
    )
    told = [f"{name} cannot be read after the change" for name in found.reach.unreadable]
    told += [f"{name} cannot be read on either side" for name in found.reach.never_readable]
    told += [f"{found.reach.left_out} more stages are touched and were not rendered"] if found.reach.left_out else []
    told += [f"no stage uses {', '.join(found.reach.unused[:20])}"] if found.reach.unused else []
    notes = "".join(f"<p>{escape(text)}</p>" for text in told)
    sections = "".join(_section(n, stage) for n, stage in enumerate(found.stages))
    write_text(
        path,
        f'<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name=viewport content="width=device-width"><title>{escape(title)}</title><style>{STYLE}{_TABLE}</style>'
        f"<h1>{escape(title)}</h1><p class=faint>{escape(found.sides.base[:12])} and {escape(found.sides.head)}</p>"
        f"<nav><ol>{listed}</ol></nav>{notes}{sections}<p class=faint>primray {__version__}</p></html>\n",
    )


def _section(n: int, stage: StageResult) -> str:
    head = (
        f'<h2>{escape(stage.stage)}</h2><p><strong class="{stage.verdict}">{stage.verdict}</strong> {escape(stage.words)}</p>'
    )
    notes = "".join(f"<p class=faint>{escape(note)}</p>" for note in stage.notes)
    pictures = "".join(_pictures(shot) for shot in stage.shots if shot.pixels)
    news = "".join(
        f"<li>{escape(row['severity'])} <code>{escape(row['code'])}</code> {escape(row['prim_path'] or '')}: "
        f"{escape(row['message'])}</li>"
        for row in stage.diagnostics
    )
    diagnostics = f"<p class=faint>What the side before does not say</p><ul>{news}</ul>" if news else ""
    return f'<section id="s{n}">{head}{notes}{pictures}{_edits(stage)}{diagnostics}</section>'


def _pictures(shot: Shot) -> str:
    stops = stops_of(shot.before, shot.after)
    before, after = (_shown(image, stops) for image in (shot.before, shot.after))
    difference = np.abs(before.astype(np.float32) - after).max(axis=2) / 64
    at = "" if shot.time is None else f"time {shot.time:g}: "
    figures = [
        figure(f"{at}before", [png(before)]),
        figure("after; before while it is pointed at", [png(after), png(before)]),
        figure("difference on the display, white a quarter and more", [png(heat(difference))]),
    ]
    words = f"{shot.pixels} pixels have other bits, {shot.seen} are seen to differ"
    words += f"; {shot.together} by several edits together alone" if shot.together else ""
    return f"<div class=pictures>{''.join(figures)}</div><p>{at}{words}</p>"


def _shown(image: Image, stops: float) -> Bytes:
    return np.ascontiguousarray(image.to_uint8(exposure=stops)[..., :3])


def _edits(stage: StageResult) -> str:
    if not stage.effects:
        return ""
    rows = "".join(_row(effect) for effect in stage.effects)
    pictures = "".join(
        figure(f"{effect.name}: pixels that it moves by itself; grey: only in bits", [png(_moved(effect))])
        for effect in stage.effects[:_MOST_FIGURES]
        if effect.pixels
    )
    return (
        "<table><tr><th>edit, made alone<th>layer or file<th>from<th>to<th>pixels<th>seen<th>box</tr>"
        f"{rows}</table><div class=pictures>{pictures}</div>"
    )


def _row(effect: Effect) -> str:
    old, new = effect.values or ("", "")
    many = "" if effect.edits == 1 else f" ({effect.edits} edits)"
    counts = [effect.failed, "", ""] if effect.failed is not None else [str(effect.pixels), str(effect.seen), _box(effect)]
    cells = [effect.name + many, effect.file, old, new, *counts]
    return "<tr>" + "".join(f"<td>{escape(str(cell))}" for cell in cells) + "</tr>"


def _box(effect: Effect) -> str:
    return "" if effect.box is None else "{}, {} to {}, {}".format(*effect.box)


def _moved(effect: Effect) -> Bytes:
    moved, seen = np.logical_or.reduce(effect.masks), np.logical_or.reduce(effect.seen_masks)
    return np.repeat(np.where(seen, 255, np.where(moved, 110, 24)).astype(np.uint8)[..., None], 3, axis=2)
