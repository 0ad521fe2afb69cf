"""Nesting of brackets in text: against a slow reader of one character at a time, and the time that hostile texts take."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest

from primray.usd.inspect.layer_content import nesting_depth, nesting_of

MOST = 10**9


@pytest.mark.parametrize(
    ("text", "depth"),
    [
        (b"", 0),
        (b"(((", 3),
        (b"[[[[]]]]()", 4),
        (b"}}}{", 0),
        (b'def "a" { [ # {{{{\n ( ] }', 3),
        (b"@a{{@ `{{` '{' \"{\" {", 1),
        (b"\"\"\"{{{ \" {{\"\"\" { '''{{ ' ''' [", 2),
        (b'"\\"{{{" {', 1),
        (b"@@@ {{ @ {{ @@@ {", 1),
        (b"/* {{{ */ // {{{\n {", 1),
        (b'"not closed {{{\n {', 1),
        (b'"""not closed {{{\n {', 0),
        (b"{" * 5000 + b"}" * 5000, 5000),
        (b"(0, 1), " * 5000, 1),
    ],
)
def test_depths(text: bytes, depth: int) -> None:
    assert nesting_of(text, MOST) == depth


def slowly(text: bytes) -> int:
    depth = deepest = 0
    at = 0
    while at < len(text):
        quote = next(
            (q for q in (b'"""', b"'''", b"@@@", b'"', b"'", b"@", b"`", b"#", b"//", b"/*") if text.startswith(q, at)), None
        )
        if quote is None:
            depth += (text[at] in b"{[(") - (text[at] in b"}])")
            deepest = max(deepest, depth)
            at += 1
            continue
        end = {b"#": b"\n", b"//": b"\n", b"/*": b"*/"}.get(quote, quote)
        of_a_line = quote in (b'"', b"'", b"@", b"`", b"#", b"//")
        at += len(quote)
        while at < len(text) and not text.startswith(end, at) and not (of_a_line and text[at] in b"\n\r"):
            at += 2 if text[at] == 0x5C and quote[:1] in b"\"'" and text[at + 1 : at + 2] not in (b"\n", b"\r") else 1
        if text.startswith(end, at) and end != b"\n":
            at += len(end)
    return deepest


def test_any_text() -> None:
    """Where a backslash ends a line of a one-line string the two differ; both are refused by USD."""
    chance = random.Random(1)
    parts = [
        b'"""',
        b"'''",
        b"@@@",
        b'"',
        b"'",
        b"@",
        b"`",
        b"#",
        b"//",
        b"/*",
        b"*/",
        b"\n",
        b"{",
        b"}",
        b"(",
        b")",
        b"[",
        b"]",
        b"x",
        b'\\"',
    ]
    for _ in range(4000):
        text = b"".join(chance.choices(parts, k=chance.randrange(30)))
        assert nesting_of(text, MOST) == slowly(text), text


def test_long_stretches_are_counted_as_short_ones() -> None:
    chance = random.Random(2)
    text = bytes(chance.choices(b"{}[]() ,0", k=1_000_000))
    depth = deepest = 0
    for byte in text:
        depth += (byte in b"{[(") - (byte in b"}])")
        deepest = max(deepest, depth)
    assert nesting_of(text, MOST) == deepest


def test_a_stretch_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"((((" + b"{[" + b"((((")
    assert (nesting_depth(path, MOST, 4, 2), nesting_depth(path, MOST), nesting_depth(path, MOST, 4)) == (2, 10, 6)
    path.write_bytes(b"")
    assert nesting_depth(path, MOST) == 0


@pytest.mark.parametrize("part", [b'"x', b"@x\n/*", b"'''\\a", b'"""', b"{'", b"@@@ @", b'\\\\"', b"/* *"])
def test_hostile_texts_take_linear_time(part: bytes) -> None:
    text = part * 200_000
    began = time.process_time()
    nesting_of(text, MOST)
    assert time.process_time() - began < 5
