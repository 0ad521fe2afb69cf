"""The label table: a JSON file that fixes the ids of classes, and of things whose own ids clash, over a data set.

    {"classes": {"class": {"car": 1, "tree": 2}}, "instances": {"class": {"/street/car7": 1234}}}

Ids are whole numbers from 1 to 2^32 - 1; 0 is what has no label. Renders add what is missing and change nothing that is there.
Several processes may add to one file at the same time: each reads it again under a lock of its folder, and renames a complete
file into place.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..diagnostics import Diagnostics
from ..errors import PrimrayError, SettingsError
from ..images.image import write_text
from ..settings import RenderSettings

LARGEST_ID = 2**32 - 1

Ids = Mapping[str, Mapping[str, int]]  # by taxonomy, by class or by a thing's path


@dataclass(frozen=True)
class LabelTable:
    """Ids of classes by taxonomy and class, and of things whose ids clash by taxonomy and path."""

    classes: Ids = field(default_factory=dict)
    instances: Ids = field(default_factory=dict)

    def with_classes(self, wanted: Mapping[str, Sequence[str]]) -> LabelTable:
        """Return the table with new classes, which get the next ids after the largest of their taxonomy, in order."""
        classes = {taxonomy: dict(ids) for taxonomy, ids in self.classes.items()}
        for taxonomy, names in wanted.items():
            own = classes.setdefault(taxonomy, {})
            for name in names:
                if name not in own:
                    own[name] = max(own.values(), default=0) + 1
        return LabelTable(classes, self.instances)

    def with_instances(self, taxonomy: str, ids: Mapping[str, int]) -> LabelTable:
        """Return the table with ids of things; those that it has remain."""
        own = dict(ids) | dict(self.instances.get(taxonomy, {}))
        return LabelTable(self.classes, {**self.instances, taxonomy: own})

    def lacks(self, wanted: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
        """Return the classes that the table does not have, by taxonomy."""
        missing = {t: [name for name in names if name not in self.classes.get(t, {})] for t, names in wanted.items()}
        return {taxonomy: names for taxonomy, names in missing.items() if names}


def read_table(path: str) -> LabelTable:
    """Return the table of a file, an empty one if there is none; SettingsError for contents that are no table."""
    try:
        text = Path(path).read_text("utf-8")
    except FileNotFoundError:
        return LabelTable()
    except (OSError, UnicodeDecodeError) as error:
        raise _error(path, f"cannot be read ({error})") from None
    try:
        says = json.loads(text)
    except ValueError as error:
        raise _error(path, f"is no JSON ({error})") from None
    if not isinstance(says, dict) or set(says) - {"classes", "instances"}:
        raise _error(path, 'is an object with "classes" and, where ids of things clash, "instances"')
    return LabelTable(_ids(path, says, "classes"), _ids(path, says, "instances"))


def _ids(path: str, says: Mapping[str, Any], member: str) -> dict[str, dict[str, int]]:
    found = says.get(member, {})
    if not isinstance(found, dict) or not all(isinstance(ids, dict) for ids in found.values()):
        raise _error(path, f'has an object of ids for each taxonomy in "{member}"')
    for taxonomy, ids in found.items():
        bad = [name for name, number in ids.items() if type(number) is not int or not 1 <= number <= LARGEST_ID]
        if bad:
            raise _error(path, f"has ids from 1 to {LARGEST_ID}; {taxonomy}: {bad[0]} has {ids[bad[0]]!r}")
        if len(set(ids.values())) < len(ids):
            twice = next(name for name in ids if list(ids.values()).count(ids[name]) > 1)
            raise _error(path, f"has one name for each id; {taxonomy}: the id {ids[twice]} of {twice} is there twice")
    return found


def _error(path: str, how: str) -> SettingsError:
    return SettingsError(f"the label table {how}", where=path, code="label-table")


def class_ids(settings: RenderSettings, wanted: Mapping[str, Sequence[str]], diagnostics: Diagnostics) -> LabelTable:
    """Return the table with ids of the wanted classes, by taxonomy; classes that are new to the settings' file are reported.

    The ids of a render without a file are places in the order of the alphabet.
    """
    if not wanted:
        return LabelTable()
    before = LabelTable() if settings.label_table is None else read_table(settings.label_table)
    table, was_there = extended_table(settings, lambda table: table.with_classes(wanted))
    if was_there:
        for taxonomy, names in before.lacks(wanted).items():
            new = ", ".join(f"{name} ({table.classes[taxonomy][name]})" for name in names)
            diagnostics.add("label-added", "", f"The label table had no ids of {taxonomy}: {new}. They are added to it.")
    return table


def extended_table(settings: RenderSettings, extend: Callable[[LabelTable], LabelTable]) -> tuple[LabelTable, bool]:
    """Return the table of the settings' file after `extend`, and whether there was a file; what is new is written to it.

    Without a file the table is extended for this render alone. PrimrayError: the file cannot be written.
    """
    path = settings.label_table
    if path is None:
        return extend(LabelTable()), False
    table = read_table(path)
    if extend(table) == table:
        return table, True
    try:
        with _locked_folder(Path(path)):
            was_there = os.path.exists(path)
            table = read_table(path)
            extended = extend(table)
            if extended != table or not was_there:
                _write(Path(path), extended)
    except OSError as error:
        raise PrimrayError(f"the label table cannot be written ({error})", where=path, code="write-failed") from None
    return extended, was_there


@contextmanager
def _locked_folder(path: Path) -> Iterator[None]:
    """Hold the lock of a file's folder; file systems without locks rely on the rename alone."""
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _write(path: Path, table: LabelTable) -> None:
    says = {"classes": table.classes} | ({"instances": table.instances} if table.instances else {})
    write_text(path, json.dumps(says, indent=1, ensure_ascii=False) + "\n")
