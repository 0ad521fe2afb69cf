"""All that `primray ci` found, as data, lines of text, an exit code, and a comment for a pull request."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..version import __version__
from .attribution import Effect, StageResult
from .changes import MARKER
from .repository import Sides
from .touched import Reach

LONGEST_COMMENT = 60_000  # bytes of UTF-8; GitHub refuses more than 65,536 letters
_SHOWN = 12  # edits of a stage in text
EXIT_CODES = {"broken": 3, "changed": 1, "new": 1, "deleted": 1, "mended": 1, "undecided": 6, "unrendered": 6}


@dataclass(frozen=True)
class Findings:
    sides: Sides
    reach: Reach
    stages: tuple[StageResult, ...]
    tolerance: float

    @property
    def exit_code(self) -> int:
        """3: a layer or a stage can no longer be read; 1: changed; 6: undecided, never readable or left out; 0: no change."""
        codes = {EXIT_CODES.get(stage.verdict, 0) for stage in self.stages}
        codes |= {3} if self.reach.unreadable else set()
        codes |= {6} if self.reach.left_out or self.reach.never_readable else set()
        return next(code for code in (3, 1, 6, 0) if code in codes | {0})

    @property
    def summary(self) -> str:
        count: dict[str, int] = {}
        for stage in self.stages:
            count[stage.verdict] = count.get(stage.verdict, 0) + 1
        told = ", ".join(f"{number} {verdict}" for verdict, number in count.items()) or "none"
        files, stages = len(self.sides.changes), len(self.stages)
        changed = "1 changed file reaches" if files == 1 else f"{files} changed files reach"
        return f"{changed} {stages} {'stage' if stages == 1 else 'stages'}: {told}"


def as_json(found: Findings) -> dict[str, Any]:
    return {
        "primray": __version__,
        "base": found.sides.base,
        "head": found.sides.head,
        "tolerance": found.tolerance,
        "exit_code": found.exit_code,
        "changes": [{"before": change.before, "after": change.after} for change in found.sides.changes],
        "unreadable": list(found.reach.unreadable),
        "never_readable": list(found.reach.never_readable),
        "unused": list(found.reach.unused),
        "left_out": found.reach.left_out,
        "stages": [_stage_json(stage) for stage in found.stages],
    }


def _stage_json(stage: StageResult) -> dict[str, Any]:
    return {
        "stage": stage.stage,
        "verdict": stage.verdict,
        "words": stage.words,
        "changes": [change.name for change in stage.changes],
        "notes": list(stage.notes),
        "diagnostics": list(stage.diagnostics),
        "times": [
            {
                "time": shot.time,
                "verdict": shot.comparison.verdict.value,
                "pixels": shot.pixels,
                "seen": shot.seen,
                "of": shot.after.resolution[0] * shot.after.resolution[1],
                "only_together": shot.together,
                "relative": shot.comparison.relative,
            }
            for shot in stage.shots
        ],
        "edits": [
            {
                "edit": effect.name,
                "file": effect.file,
                "values": effect.values,
                "edits": effect.edits,
                "pixels": effect.pixels,
                "seen": effect.seen,
                "box": effect.box,
                "failed": effect.failed,
            }
            for effect in stage.effects
        ],
    }


def lines(found: Findings) -> Iterator[str]:
    yield found.summary
    for path in found.reach.unreadable:
        yield f"  broken: {path} cannot be read after the change"
    for path in found.reach.never_readable:
        yield f"  {path} cannot be read on either side"
    if found.reach.left_out:
        yield f"  {found.reach.left_out} more stages are touched and were not rendered (--most)"
    for stage in found.stages:
        yield f"{stage.verdict}: {stage.stage}{f': {stage.words}' if stage.words else ''}"
        yield from (f"  note: {note}" for note in stage.notes)
        for shot in stage.shots:
            at = "" if shot.time is None else f"time {shot.time:g}: "
            yield f"  {at}{shot.pixels} pixels have other bits, {shot.seen} are seen to differ"
        for effect in stage.effects[:_SHOWN]:
            yield f"  {effect_words(effect)}"
        if len(stage.effects) > _SHOWN:
            yield f"  and {len(stage.effects) - _SHOWN} more edits"
        if together := sum(shot.together for shot in stage.shots):
            yield f"  {together} pixels change by several edits together alone"
        for row in stage.diagnostics[:_SHOWN]:
            yield f"  new {row['severity']}: {row['code']} {row['prim_path'] or ''}: {row['message']}"


def effect_words(effect: Effect) -> str:
    values = "" if effect.values is None else f": {effect.values[0]} -> {effect.values[1]}"
    many = "" if effect.edits == 1 else f" ({effect.edits} edits)"
    if effect.failed is not None:
        return f"{effect.name}{many}{values}: cannot be made alone: {effect.failed}"
    where = "" if effect.box is None else " in {}..{} x {}..{}".format(*(effect.box[k] for k in (0, 2, 1, 3)))
    return f"{effect.name}{many}{values}: {effect.pixels} pixels, {effect.seen} seen{where}"


def comment(found: Findings, link: str = "") -> str:
    """Return Markdown of at most LONGEST_COMMENT bytes that begins with a hidden marker, by which it is found again."""
    parts = [MARKER, f"### primray ci: {found.summary}", f"Base {found.sides.base[:12]}, {found.sides.head}."]
    if link:
        parts.append(f"[Page with pictures]({link})")
    parts += [f"- **broken**: {_code(path)} cannot be read after the change" for path in found.reach.unreadable]
    parts += [f"- {_code(path)} cannot be read on either side" for path in found.reach.never_readable]
    if found.reach.left_out:
        parts.append(f"{found.reach.left_out} more stages are touched and were not rendered.")
    parts += ["\n".join(_section(stage)) for stage in found.stages]
    ending = "\n\nThis is cut: the page has all of it."
    text = ""
    for part in parts:
        longer = f"{text}\n\n{part}" if text else part
        if len((longer + ending).encode(errors="backslashreplace")) >= LONGEST_COMMENT:
            return text + ending + "\n"
        text = longer
    return text + "\n"


def _section(stage: StageResult) -> Iterator[str]:
    yield f"**{stage.verdict}** {_code(stage.stage)} {_plain(stage.words)}"
    yield from (f"- note: {_plain(note)}" for note in stage.notes[:_SHOWN])
    rows: Sequence[Effect] = stage.effects[:_SHOWN]
    if rows:
        yield ""
        yield "| edit | file | from | to | pixels | seen |"
        yield "|---|---|---|---|---|---|"
        for effect in rows:
            old, new = effect.values or ("", "")
            counts = ("-", effect.failed) if effect.failed is not None else (effect.pixels, effect.seen)
            cells = (_code(effect.name), _code(effect.file), _code(old), _code(new), *(_plain(str(each)) for each in counts))
            yield "| " + " | ".join(cells) + " |"
    if len(stage.effects) > _SHOWN:
        yield f"and {len(stage.effects) - _SHOWN} more edits"
    for row in stage.diagnostics[:_SHOWN]:
        yield f"- new {row['severity']} {_code(row['code'])} {_code(row['prim_path'] or '')} {_plain(row['message'])}"


def _plain(text: str) -> str:
    """Return text that Markdown shows as it is: what a stage's author wrote makes no links, mentions or HTML."""
    return "".join(
        f"&#{ord(letter)};" if letter in "<>&@#[]()*_`|!\\~:" else " " if letter in "\r\n" else letter for letter in text
    )


def _code(text: str) -> str:
    return f"<code>{_plain(text)}</code>" if text else ""
