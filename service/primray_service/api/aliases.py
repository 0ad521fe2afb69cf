"""Other names of members: aliases of settings from the command line and the library, and hints for names that are unknown.

Aliases are translated to the API's own names when a request is read; documents use those only. A request that does not fit its
model is answered with the member or value that was probably meant.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from primray.errors import did_you_mean

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


# Members by their names elsewhere; keys are the last components of the member's path.
_ALIASES: dict[tuple[str, ...], str] = {
    ("stop", "max_seconds"): "deadline duration max_time seconds time timeout",
    ("stop", "max_samples"): "max_spp num_samples sample_count samples samples_per_pixel",
    ("stop", "target_error"): "noise noise_threshold quality threshold",
    ("settings", "resolution"): "height image_height image_width size width",
    ("settings", "frames"): "frame_range",
    ("settings", "denoise"): "denoiser denoising",
    ("settings", "aovs"): "layers outputs passes render_passes",
    ("settings", "max_depth"): "bounces max_bounces ray_depth",
    ("settings", "dome"): "env environment hdri",
    ("settings", "camera"): "cam",
    ("labels",): "tags",
    ("webhook",): "callback callback_url",
}
_MEANT = {alias: member for member, aliases in _ALIASES.items() for alias in aliases.split()}
_QUOTED = re.compile(r"'([^']*)'")
_LONGEST = 100  # longest name or value that is compared, in characters


def hint_of(found: Mapping[str, Any], model: type[BaseModel] | None = None) -> str:
    """Return "; did you mean X?" for one of pydantic's errors, or "" where nothing is near.

    An unknown member is compared with those of its own object; one that belongs to another object of the same request is named
    with the path that it belongs to.
    """
    if found["type"] == "extra_forbidden" and model is not None:
        hint = _member(model, [str(part) for part in found["loc"]])
    elif found["type"] in ("literal_error", "enum") and isinstance(found.get("input"), str):
        expected = _QUOTED.findall(str(found.get("ctx", {}).get("expected", "")))
        hint = did_you_mean(found["input"][:_LONGEST], expected)
    else:
        hint = ""
    return f"; {hint}" if hint else ""


def _member(model: type[BaseModel], place: Sequence[str]) -> str:
    *above, name = place
    known = list(_members(model))
    meant = _MEANT.get(name.casefold())
    if meant is not None and (fitting := [path for path in known if path[-len(meant) :] == meant]):
        return f"did you mean {'.'.join(fitting[0])}?"
    if hint := did_you_mean(name[:_LONGEST], [path[-1] for path in known if path[:-1] == tuple(above)]):
        return hint
    elsewhere = [".".join(path) for path in known if path[-1] == name]
    return f"did you mean {elsewhere[0]}?" if elsewhere else ""


def _members(model: type[BaseModel], above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the paths of all members, including those of nested objects."""
    for name, field in model.model_fields.items():
        path = (*above, field.alias or name)
        yield path
        for inner in _models(field.annotation):
            yield from _members(inner, path)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)
