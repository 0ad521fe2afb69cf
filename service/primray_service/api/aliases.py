"""Aliases of settings: names from the command line and the library, translated to the API's own.

Aliases are translated when a request is read; documents use the API's names only.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

from ..problems import Problem

# Aliases by API member: flags of `primray render`, fields of `primray.RenderSettings`.
STOP_WORDS: dict[str, tuple[str, ...]] = {
    "max_samples": ("spp", "pixel_samples"),
    "max_seconds": ("time_limit", "time_limit_s"),
    "metric": ("error_metric",),
    "target_error": (),
}
WORDS: dict[str, tuple[str, ...]] = {
    "resolution": ("res",),
    "frames": ("frame",),
    "aovs": ("aov",),
    "purposes": ("purpose",),
    "variants": ("variant",),
    "products": ("product",),
    "default_light": ("no_default_light",),
}
# Conversions for aliases whose values have another form.
MEANT: dict[str, Callable[[Any], Any]] = {
    "product": lambda value: [value] if isinstance(value, str) else value,
    "no_default_light": lambda value: not value if isinstance(value, bool) else value,
}

_OF_STOP = frozenset(word for others in STOP_WORDS.values() for word in others)
_OF_SETTINGS = _OF_STOP | STOP_WORDS.keys() | {word for others in WORDS.values() for word in others}


def in_own_words(document: Any) -> Any:
    """Return a request's JSON with the API's own members; the same object if it has them already.

    Raises Problem if one setting is given twice with different values.
    """
    if not isinstance(document, dict) or not _has_other_words(document):
        return document
    document = copy.deepcopy(document)
    if isinstance(document.get("stop"), dict):
        _rename(document["stop"], STOP_WORDS, "stop")
    settings = document.get("settings")
    if isinstance(settings, dict):
        _rename(settings, WORDS, "settings")
        stop = settings.setdefault("stop", {}) if _words_of_stop(settings) else settings.get("stop")
        if isinstance(stop, dict):
            _rename(stop, STOP_WORDS, "settings.stop")
            _move(settings, stop)
    return document


def _has_other_words(document: dict[str, Any]) -> bool:
    settings = document.get("settings")
    places = [(document.get("stop"), _OF_STOP)]
    if isinstance(settings, dict):
        places += [(settings, _OF_SETTINGS), (settings.get("stop"), _OF_STOP)]
    return any(isinstance(members, dict) and not words.isdisjoint(members) for members, words in places)


def _words_of_stop(settings: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the rules given beside `stop`, with the members that they stand for."""
    return [(word, own) for own, others in STOP_WORDS.items() for word in (own, *others) if word in settings]


def _rename(members: dict[str, Any], words: dict[str, tuple[str, ...]], place: str) -> None:
    for own, others in words.items():
        for word in others:
            if word in members:
                _put(members, own, MEANT.get(word, lambda value: value)(members.pop(word)), place, word)


def _move(settings: dict[str, Any], stop: dict[str, Any]) -> None:
    for word, own in _words_of_stop(settings):
        _put(stop, own, settings.pop(word), "settings.stop", word)


def _put(members: dict[str, Any], own: str, value: Any, place: str, word: str) -> None:
    if own in members and members[own] != value:
        member = f"{place}.{own}"
        detail = f"{member}: it is also given as {word}, with another value; give one of them."
        raise Problem("invalid-request", detail, member=member, errors=[{"member": member, "detail": detail}])
    members[own] = value
