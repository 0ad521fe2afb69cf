"""docs/stage-settings.md has every attribute that is read and every flag that takes its place."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from primray.cli.app import with_options
from primray.cli.commands.render import render
from primray.cli.quick import TABLE
from primray.usd.render_settings.stage_settings import NAMES, VARIABLES
from primray.usd.scene.schemas import ERROR_THRESHOLDS, SETTINGS_OF_OTHERS

PAGE = (Path(__file__).parents[2] / "docs/stage-settings.md").read_text(encoding="utf-8")
OURS = re.findall(r"^\| `(primray:\w+)` \| \w+ \| .* \| (.*) \|$", PAGE, re.MULTILINE)


def test_the_table_has_every_attribute() -> None:
    assert {name for name, _ in OURS} == set(NAMES)
    assert all(name in PAGE for name in VARIABLES)


def test_each_flag_leaves_to_the_stage_what_is_not_said() -> None:
    parameters = inspect.signature(with_options("render", render)).parameters
    by_flag = {flag: name for name, (_, flags) in TABLE.items() for flag in flags}
    for attribute, flags in OURS:
        for flag in re.findall(r"`(--[\w-]+)`", flags):
            assert parameters[by_flag[flag]].default is None, (attribute, flag)


def test_what_is_read_of_others_is_there() -> None:
    for name in SETTINGS_OF_OTHERS - set(ERROR_THRESHOLDS):
        assert name.rpartition(":")[2] in PAGE, name
