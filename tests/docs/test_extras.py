"""The extras that the page about installing names are those that the package has."""

from __future__ import annotations

import re
import tomllib

from .test_notice import OURS, ROOT


def test_every_extra_is_named_and_there_are_no_others() -> None:
    text = (ROOT / "docs" / "installing.md").read_text(encoding="utf-8")
    sentence = text[text.index("Extras add") :].split("\n\n")[0]
    named = {(a or b) for a, b in re.findall(r"`primray\[(\w+)\]`|`(\w+)`", sentence)}
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert named == set(extras) - OURS
