"""Hints for a request that does not fit its model: the member or the value that was probably meant."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from primray.errors import did_you_mean

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
