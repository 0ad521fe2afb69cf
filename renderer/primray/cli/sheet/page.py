"""A contact sheet as one HTML file: every picture with its time, memory, diagnostics and anomalies."""

from __future__ import annotations

import base64
import html
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ...notices.diagnostics_text import diagnostics_lines
from .runs import Outcome

_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 1.5em; background: #fafafa; color: #222 }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(290px, 1fr)); gap: 1em }
figure { margin: 0; padding: .6em; background: #fff; border: 1px solid #ddd; border-radius: 6px; overflow: hidden }
figure.failed { border: 2px solid #c00 } figure.odd { border: 2px solid #d90 }
img { width: 100%; background: repeating-conic-gradient(#ccc 0 25%, #eee 0 50%) 0 0 / 16px 16px }
figcaption b { overflow-wrap: anywhere } .mark { color: #c00; font-weight: bold }
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: 11px; margin: .3em 0 0; max-height: 16em; overflow: auto }
table { border-collapse: collapse } td { padding: 0 1em 0 0 }
"""


def page(title: str, outcomes: Sequence[Outcome]) -> str:
    figures = "\n".join(_figure(outcome) for outcome in outcomes)
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title><style>{_STYLE}</style>"
        f"<h1>{html.escape(title)}</h1>{_totals(outcomes)}<main>{figures}</main></html>\n"
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
        f'<figure class="{kind}" id="{html.escape(outcome.stage)}">{_image(outcome.picture)}<figcaption>'
        f"<b>{html.escape(outcome.stage)}</b><br>{marks}{outcome.seconds:.1f} s, "
        f"{outcome.peak_rss_bytes / 2**20:.0f} MiB{ended}<pre>{html.escape(chr(10).join(text))}</pre></figcaption></figure>"
    )


def _image(picture: str | None) -> str:
    if picture is None:
        return ""
    data = base64.b64encode(Path(picture).read_bytes()).decode()
    return f'<img loading=lazy alt="" src="data:image/png;base64,{data}">'
