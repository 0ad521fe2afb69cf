"""A setting as one row: the field of RenderSettings itself, with all that the rest of the project derives from it.

`setting(default, reader, ...)` declares a field. From `rows(RenderSettings)` are derived: the conversion and the check of
values, their JSON, the identity of checkpoints, what a scene that is rendered again keeps, the flags of commands (cli/flags.py)
and the members of the service's API (primray_service/api/models.py).

Readers convert what users pass for a setting to its stored form, or refuse it with the setting's name. Strings become enum
members, lists and arrays tuples, NumPy's numbers Python's, prims and Sdf.Paths paths. They check the form only.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, fields
from enum import Enum
from typing import Any, Generic, NamedTuple, TypeVar

from ..errors import SettingsError

Reader = Callable[[str, Any], Any]  # (the setting's name, the value passed) -> the value stored
Check = Callable[[str, Any], object]  # (the setting's name, the value stored); raises SettingsError or LimitError

SomeEnum = TypeVar("SomeEnum", bound=Enum)
Default = TypeVar("Default")
Value = TypeVar("Value")


class Counts(Enum):
    """What a setting decides: the identity of a checkpoint holds what decides pixels, and names what decides the scene."""

    NEITHER = "neither"  # when to stop, what to write, how much of the machine to use
    PIXELS = "pixels"
    BIAS = "bias"  # pixels, by removing sampled light; the default removes none
    SCENE = "scene"
    STAGING = "staging"  # the scene, by additions to the stage; the default adds nothing


# Commands of a flag: those that open a stage, sample it, make its picture, or draw it in their own process.
OPENING = frozenset({"render", "estimate", "inspect", "doctor", "explain", "submit", "view", "pin"})
RENDERING = frozenset({"render", "estimate", "explain", "submit", "pin"})
PICTURES = frozenset({"render", "submit", "pin"})
DRAWING = frozenset({"render", "view"})


class OnOff(Enum):
    """A switch whose flag takes a word."""

    ON = "on"
    OFF = "off"


class Flag(NamedTuple):
    """A flag of commands, or an argument if it has no names. `form` is the type that it is read as.

    Other commands than `commands` may have it as a parameter, with a default of their own.
    """

    names: tuple[str, ...]
    help: str
    form: Any = None  # None: what the setting's reader takes
    metavar: str | None = None
    shown: str | bool = True  # the default as `--help` shows it; True: its value
    commands: frozenset[str] = OPENING
    default: Any = None


class Member(NamedTuple):
    """A member of the API's settings, or of its stop rules ("stop.NAME"), with the bounds of its values."""

    help: str = ""
    name: str = ""  # "": the setting's
    bounds: Mapping[str, float] = {}
    chars: int | None = None  # at most, in a string
    items: tuple[int, int] = (0, 0)  # at least and at most, in a list
    choices: tuple[str, ...] = ()  # of the strings in a list
    is_open: bool = False  # null leaves a setting with a default to the renderer
    is_derived: bool = True  # False: api/models.py has it in another form


class Row(NamedTuple):
    """One setting. Its name and default are the field's."""

    name: str
    default: Any
    read: Reader
    check: Check | None
    counts: Counts
    is_of_sampling: bool
    is_seldom: bool
    flag: Flag | None
    member: Member | None

    def value_of(self, given: Any) -> Any:
        """Return the stored form of a value; SettingsError or LimitError for one that cannot be meant."""
        if given is None and self.default is None:
            return None
        value = self.read(self.name, given)
        if self.check is not None:
            self.check(self.name, value)
        return value


def setting(
    default: Default,
    read: Callable[[str, Any], Value],
    *,
    check: Check | None = None,
    counts: Counts = Counts.NEITHER,
    sampling: bool = False,
    seldom: bool = False,
    flag: Flag | None = None,
    member: Member | None = None,
) -> Default | Value:
    """Declare a field of RenderSettings.

    `check` sees values other than None. `sampling`: the translated scene does not depend on it; where dicing or building does,
    incremental/steps.py compares it. `seldom`: files and reports
    leave it out at its default, as they do with bias and staging.
    """
    is_seldom = seldom or counts in (Counts.BIAS, Counts.STAGING)
    row = Row("", default, read, check, counts, sampling, is_seldom, flag, member)
    declared: Any = field(default=default, metadata={"row": row})
    return declared  # type: ignore[no-any-return]


_ROWS: dict[type, tuple[Row, ...]] = {}


def rows(of: type) -> tuple[Row, ...]:
    """Return the settings of a dataclass in their order."""
    if of not in _ROWS:
        _ROWS[of] = tuple(each.metadata["row"]._replace(name=each.name) for each in fields(of))
    return _ROWS[of]


def files_of_jobs(of: type) -> tuple[str, ...]:
    """Return the settings of the service's API that name a file of the scene's package."""
    return tuple(row.name for row in rows(of) if row.read is file and row.member is not None)


def settings_as_json(settings: Any) -> dict[str, Any]:
    """Return settings as reports and checkpoints store them; `settings_of_json` reads them."""
    values = [(row, getattr(settings, row.name)) for row in rows(type(settings))]
    return {row.name: as_json(value) for row, value in values if not row.is_seldom or value != row.default}


def as_json(value: Any) -> Any:
    """Return the value of a setting as plain JSON."""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [as_json(item) for item in value]
    if hasattr(value, "world_from_camera"):
        from ..camera import camera_as_json

        return camera_as_json(value)
    return value


def must(holds: Callable[[Any], bool], sentence: str) -> Check:
    """Return a check that raises SettingsError, "SENTENCE, not VALUE"."""

    def check(name: str, value: Any) -> None:
        if not holds(value):
            raise SettingsError(f"{sentence}, not {value}", where=name)

    return check


MOST_WHOLE = 2**63 - 1  # beyond it a whole number is no number of anything
# The largest time code, and the most degrees of a turn: between neighbouring doubles there is less than a millionth here.
LARGEST_NUMBER = 10**9


def is_moderate(value: float) -> bool:
    """Return whether a time code or an angle is one that somebody may mean: frames and turns beyond are mistakes."""
    return abs(value) <= LARGEST_NUMBER  # false for nan


def is_positive(value: float) -> bool:
    return math.isfinite(value) and value > 0


def is_natural(value: float) -> bool:
    return value >= 1


def not_empty(name: str, value: str) -> None:
    if not value:
        raise SettingsError(f"{name} must not be empty", where=name)


def refused(name: str, wanted: str, value: object) -> SettingsError:
    is_huge = isinstance(value, int) and abs(value) > MOST_WHOLE  # its digits may be more than Python writes
    shown = "a larger one" if is_huge else repr(value)
    return SettingsError(f"{name} must be {wanted}, not {shown if len(shown) <= 80 else f'{shown[:77]}...'}", where=name)


def whole(name: str, value: Any) -> int:
    value = _plain(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise refused(name, "a whole number", value)
    if abs(value) > MOST_WHOLE:
        raise refused(name, "a whole number of at most 63 bits", value)
    return value


def number(name: str, value: Any) -> float:
    value = _plain(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise refused(name, "a number", value)
    if isinstance(value, int) and abs(value) > MOST_WHOLE:
        raise refused(name, "a number of at most 63 bits where it is whole", value)
    return value


def yes_or_no(name: str, value: Any) -> bool:
    value = _plain(value)
    if not isinstance(value, bool):
        raise refused(name, "True or False", value)
    return value


def text(name: str, value: Any) -> str:
    """Return a string; prims, Sdf.Paths and pathlib.Paths are converted."""
    if hasattr(value, "GetPath"):
        value = value.GetPath()
    value = getattr(value, "pathString", value)
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if not isinstance(value, str):
        raise refused(name, "a string", value)
    return str(value)


def file(name: str, value: Any) -> str:
    """Return the name of a file."""
    return text(name, value)


def texts(name: str, value: Any) -> tuple[str, ...]:
    return tuple(text(name, item) for item in _items(name, "strings", value))


def pair(name: str, value: Any) -> tuple[int, int]:
    a, b = _items(name, "two whole numbers", value, 2)
    return whole(name, a), whole(name, b)


def two_numbers(name: str, value: Any) -> tuple[float, float]:
    a, b = _items(name, "two numbers", value, 2)
    return number(name, a), number(name, b)


def four_numbers(name: str, value: Any) -> tuple[float, float, float, float]:
    left, bottom, right, top = (number(name, item) for item in _items(name, "four numbers", value, 4))
    return left, bottom, right, top


class choice(Generic[SomeEnum]):
    """Reader of an enum's members or their values."""

    def __init__(self, kinds: type[SomeEnum]) -> None:
        self.kinds = kinds

    def __call__(self, name: str, value: Any) -> SomeEnum:
        try:
            return self.kinds(value)
        except ValueError:
            known = ", ".join(repr(kind.value) for kind in self.kinds)
            raise refused(name, f"one of {known}", value) from None


def _plain(value: Any) -> Any:
    """Return a NumPy scalar as a Python number; other values unchanged."""
    return value.item() if getattr(value, "shape", None) == () and hasattr(value, "item") else value


def _items(name: str, wanted: str, value: Any, count: int | None = None) -> list[Any]:
    """Return the items of a list, `count` of them if that is given; a string is not taken for a list of its characters."""
    if isinstance(value, Mapping | str | bytes) or not isinstance(value, Iterable):
        raise refused(name, f"a list of {wanted}", value)
    items = sorted(value) if isinstance(value, set | frozenset) else list(value)
    if count is not None and len(items) != count:
        raise refused(name, wanted, value)
    return items
