"""A contact sheet as a picture with labels in a grid, or as an HTML file with times, memory and diagnostics."""

from __future__ import annotations

import base64
import html
import re
import struct
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..diagnostic_messages import diagnostics_lines
from .sheet_renders import Outcome

_SHEET, _BEHIND, _FAILED = 0.10, 0.25, (0.32, 0.08, 0.08)  # colours of the sheet, behind pictures, and of failed pictures
_WHITE, _ODD = (0.92, 0.92, 0.92), (1.0, 0.65, 0.2)
_FONT, _TITLE_FONT = 13, 17  # pixels
_GAP, _STRIP, _LINE, _TITLE = 8, 20, 15, 30  # pixels between cells, of a label, of each further label line, of the title
Text = tuple[int, int, str, int, tuple[float, float, float]]  # x, y of the baseline, text, size, colour
_ERROR = re.compile(r"^error: ", re.MULTILINE)


def contact_sheet(title: str, groups: Sequence[Sequence[Outcome]], columns: int, width: int) -> np.ndarray[Any, Any]:
    """Draw the sheet, 8-bit (H, W, 3). Each group begins a row; rows are as high as the highest picture."""
    rows = [group[k : k + columns] for group in groups for k in range(0, len(group), columns)]
    pictures = {id(outcome): _picture(outcome) for row in rows for outcome in row}
    height = max((picture.shape[0] for picture in pictures.values() if picture is not None), default=width * 9 // 16)
    labels = {id(outcome): _lines(outcome, width) for row in rows for outcome in row}
    strip = _STRIP + _LINE * (max(map(len, labels.values())) - 1)
    cell_height, across = height + strip + _GAP, max(map(len, rows))
    shape = (_TITLE + len(rows) * cell_height + _GAP, across * (width + _GAP) + _GAP, 3)
    sheet = np.full(shape, _SHEET, np.float32)
    texts: list[Text] = [(_GAP, _TITLE - 10, _fitting(title, shape[1] - 2 * _GAP, _TITLE_FONT), _TITLE_FONT, _WHITE)]
    for y, row in enumerate(rows):
        for x, outcome in enumerate(row):
            left, top = _GAP + x * (width + _GAP), _TITLE + y * cell_height
            picture = pictures[id(outcome)]
            sheet[top : top + height, left : left + width] = _BEHIND if picture is not None else _FAILED
            if picture is not None:
                seen = picture[:height, :width]
                sheet[top : top + seen.shape[0], left : left + seen.shape[1]] = seen
            else:
                texts += list(_reason(outcome, left, top, width, height))
            color = _ODD if outcome.marks or picture is None else _WHITE
            for k, line in enumerate(labels[id(outcome)]):
                texts.append((left, top + height + 15 + k * _LINE, line, _FONT, color))
    return _with_texts(sheet, texts)


def _picture(outcome: Outcome) -> Floats | None:
    """Return the display values of a picture, over grey where it is transparent."""
    import OpenImageIO as oiio

    if outcome.picture is None:
        return None
    values = np.asarray(oiio.ImageBuf(outcome.picture).get_pixels(oiio.FLOAT), np.float32)
    if values.shape[2] == 4:
        return values[..., :3] + (1 - values[..., 3:]) * np.float32(_BEHIND)
    return values[..., [0, 0, 0]] if values.shape[2] < 3 else values[..., :3]


def reason(outcome: Outcome) -> str:
    """Return one line on why there is no picture: the error of its process, or how it ended."""
    if outcome.exit_code == "time":
        return "stopped by the time limit"
    errors = _ERROR.split(outcome.message)[1:]
    if errors:
        return errors[-1].strip().splitlines()[0]
    last = outcome.message.strip().splitlines()[-1:]
    return last[0] if last else f"ended with {outcome.exit_code}"


def _reason(outcome: Outcome, left: int, top: int, width: int, height: int) -> Iterator[Text]:
    heading = f"failed, exit {outcome.exit_code}" if isinstance(outcome.exit_code, int) else "failed"
    lines = [heading, *textwrap.wrap(reason(outcome), max(8, int(width / (0.52 * _FONT))))]
    for k, line in enumerate(lines[: max(1, (height - 6) // (_FONT + 3))]):
        yield left + 6, top + 16 + k * (_FONT + 3), _fitting(line, width - 12, _FONT), _FONT, _WHITE


def _lines(outcome: Outcome, width: int) -> list[str]:
    """Return the label of a picture broken at commas to lines that fit; of a longer word the end, which is distinctive."""
    label = outcome.stage if not outcome.marks else f"{outcome.stage} ({', '.join(outcome.marks)})"
    first, *words = label.split(", ")
    lines = [first]
    for word in words:
        if _fits(f"{lines[-1]}, {word}", width, _FONT):
            lines[-1] += f", {word}"
        else:
            lines.append(word)
    return [line if _fits(line, width, _FONT) else _fitting(line[::-1], width, _FONT)[::-1] for line in lines]


def _fitting(text: str, width: int, size: int) -> str:
    """Return as much of the beginning of the text as fits."""
    if _fits(text, width, size):
        return text
    while text and not _fits(text + "...", width, size):
        text = text[:-1]
    return text + "..."


def _fits(text: str, width: int, size: int) -> bool:
    import OpenImageIO as oiio

    return bool(oiio.ImageBufAlgo.text_size(text, size).width <= width)


def _with_texts(sheet: Floats, texts: Sequence[Text]) -> np.ndarray[Any, Any]:
    import OpenImageIO as oiio

    height, width, channels = sheet.shape
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, oiio.FLOAT))
    buffer.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, channels), sheet)
    for x, y, words, size, color in texts:
        oiio.ImageBufAlgo.render_text(buffer, x, y, words, size, "", color)
    drawn = np.asarray(buffer.get_pixels(oiio.FLOAT)).reshape(sheet.shape)
    made: np.ndarray[Any, Any] = (np.clip(drawn, 0, 1) * 255 + 0.5).astype(np.uint8)
    return made


_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 1.5em; background: #fafafa; color: #222 }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(290px, 1fr)); gap: 1em }
figure { margin: 0; padding: .6em; background: #fff; border: 1px solid #ddd; border-radius: 6px; overflow: hidden }
figure.failed { border: 2px solid #c00 } figure.odd { border: 2px solid #d90 }
img { width: 100%; height: auto; background: repeating-conic-gradient(#ccc 0 25%, #eee 0 50%) 0 0 / 16px 16px }
figcaption b { overflow-wrap: anywhere } .mark { color: #c00; font-weight: bold }
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: 11px; margin: .3em 0 0; max-height: 16em; overflow: auto }
table { border-collapse: collapse } td { padding: 0 1em 0 0 }
input { font: inherit; width: 20em; max-width: 100%; margin: 1em 0 } figure[hidden] { display: none }
"""
# All words that are typed must be in the stage's path; the page's address keeps them, so that a search can be sent on.
_SEARCH = """
const field = document.querySelector("input"), count = document.querySelector("output")
const figures = [...document.querySelectorAll("figure")]
function search() {
  const words = field.value.toLowerCase().split(/\\s+/).filter(Boolean)
  for (const each of figures) each.hidden = !words.every((word) => each.id.toLowerCase().includes(word))
  count.textContent = `${figures.filter((each) => !each.hidden).length} of ${figures.length}`
  history.replaceState(null, "", field.value ? `#search=${encodeURIComponent(field.value)}` : location.pathname)
}
const asked = /^#search=(.*)/.exec(location.hash)
if (asked) field.value = decodeURIComponent(asked[1])
field.addEventListener("input", search)
if (asked) search()
"""


def page(title: str, outcomes: Sequence[Outcome]) -> str:
    figures = "\n".join(_figure(outcome) for outcome in outcomes)
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title><style>{_STYLE}</style>"
        f"<h1>{html.escape(title)}</h1>{_totals(outcomes)}"
        f"<label>Search by name: <input type=search></label> <output aria-live=polite>{len(outcomes)}</output>"
        f"<main>{figures}</main><script>{_SEARCH}</script></html>\n"
    )


def _totals(outcomes: Sequence[Outcome]) -> str:
    marks = Counter(mark for outcome in outcomes for mark in outcome.marks)
    exits = Counter(str(outcome.exit_code) for outcome in outcomes)
    codes = Counter(code for outcome in outcomes for code in {d["code"] for d in outcome.report.get("diagnostics", ())})
    rows = [
        ("stages", str(len(outcomes))),
        ("seconds", f"{sum(outcome.seconds for outcome in outcomes):.0f} of processes"),
        ("exit codes", _counted(exits)),
        ("marked", _counted(marks) or "none"),
        ("diagnostics, by stages", _counted(codes)),
    ]
    return "<table>" + "".join(f"<tr><td>{name}<td>{html.escape(text)}" for name, text in rows) + "</table>"


def _counted(counter: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counter.most_common())


def _figure(outcome: Outcome) -> str:
    kind = "failed" if outcome.failed else "odd" if outcome.marks else ""
    text = diagnostics_lines(outcome.report.get("diagnostics", ()))
    text = [outcome.message, *text] if outcome.message and not text else text
    marks = f"<span class=mark>{html.escape(', '.join(outcome.marks))}</span> " if outcome.marks else ""
    ended = "" if outcome.exit_code == 0 else f", exit {outcome.exit_code}"
    return (
        f'<figure class="{kind}" id="{html.escape(outcome.stage)}">{_image(outcome.stage, outcome.picture)}<figcaption>'
        f"<b>{html.escape(outcome.stage)}</b><br>{marks}{outcome.seconds:.1f} s, "
        f"{outcome.peak_rss_bytes / 2**20:.0f} MiB{ended}<pre>{html.escape(chr(10).join(text))}</pre></figcaption></figure>"
    )


def _image(stage: str, picture: str | None) -> str:
    """Return a picture that has its place on the page before a browser has decoded it."""
    if picture is None:
        return ""
    data = Path(picture).read_bytes()
    width, height = struct.unpack_from(">II", data, 16)  # a PNG's header
    place = f'width={width} height={height} alt="{html.escape(stage)}"'
    return f'<img loading=lazy {place} src="data:image/png;base64,{base64.b64encode(data).decode()}">'
