"""A dome turned after the render: the light of its group is rendered again, alone, and takes the place of its part in the mix.

The turn of a dome is not linear in what it emits, so its part cannot be weighed. But all other parts stay as they are. The new
render has the picture's settings, seed included: pixels draw the same points of the lens and the filter in it, so that signed
differences of replicates keep what the group and the other lights have in common.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_args

from ..aovs import LIGHTS
from ..arrays import Doubles
from ..description import Light, LightType, SceneDescription
from ..description.scene import without_emission
from ..diagnostics import Diagnostics
from ..errors import SettingsError
from ..light_mix.mix import LightMix, LightPart
from ..report.report import Costs
from ..settings import RenderSettings, rows
from ..settings.forms import form_of
from ..settings.setting import Row, choice
from ..staging import turn_about_up
from .prepare import Steps, Textures, open_once
from .render import render_opened

if TYPE_CHECKING:
    from ..images.image import Image
    from ..sampling.sampling import Progress

CODE = "lights-turn"
COMPOSING = ("variants", "load", "mask", "session_layer")  # settings that decide what is on the stage
# What the new render decides itself.
OWN = ("aovs", "spp", "target_error", "time_limit_s", "adaptive", "denoise", "stop_at", "mixes", "background", "ground")


def turn_dome(
    picture: LightMix | Image | str | os.PathLike[str],
    stage: str | os.PathLike[str] | Any,
    turns: Mapping[str, float],
    *,
    spp: int | None = None,
    progress: Progress | None = None,
) -> LightMix:
    """Return the mix with domes turned about the stage's up axis, in degrees, counterclockwise as seen from above.

    >>> image = primray.render("shot.usda", aovs=["lights"], resolution=(32, 18), spp=4)
    >>> mix = primray.turn_dome(image, "shot.usda", {"sky": 90})
    >>> mix.mixed({"sun": 0.5}).resolution
    (32, 18)

    `turns`: by the name of a part or the path of a dome. The dome's group is rendered again without all other lights, with the
    picture's settings; `spp`: its samples per pixel; None: as many as the picture has on average. `stage` is the one that was
    rendered. SettingsError if a part has no dome, or the picture's header lacks the settings of a render.
    """
    mix = picture if isinstance(picture, LightMix) else LightMix.of(picture)
    for name, degrees in turns.items():
        part = _part_of(mix, name)
        settings = settings_of_header(mix.image.metadata, mix.image.resolution, spp)
        mix = mix.with_part(_rendered(stage, settings, part, name, degrees, progress), {f"turn.{part.name}": degrees})
    return mix


def _part_of(mix: LightMix, name: str) -> LightPart:
    for part in mix.parts:
        if name == part.name or name in part.paths:
            return part
    has = f"it has {', '.join(mix.names)}"
    raise SettingsError(f"there is no light {name!r} in the picture; {has}", where=name, code="lights-unknown")


def _rendered(
    stage: Any, settings: RenderSettings, part: LightPart, name: str, degrees: float, progress: Progress | None
) -> LightPart:
    """Return the part as it is with its domes turned, or the one of that path."""
    if not math.isfinite(degrees):
        raise SettingsError(f"a turn is a number of degrees, not {degrees}", where=name, code=CODE)
    steps = _GroupAlone(part.paths, part.paths if name == part.name else (name,), degrees)
    opened, costs = open_once(stage, settings), Costs()
    image = render_opened(opened, settings, costs, progress, "raise", None, (), lambda told: None, steps)
    if image.resolution != part.light.shape[1::-1]:
        sentence = "the stage gives a picture of another size: it is not the one that was rendered"
        raise SettingsError(sentence, where=name, code=CODE)
    again = next(one for one in LightMix.of(image).parts if set(one.paths) & set(part.paths))
    return LightPart(part.name, again.light, again.difference, part.paths)


class _GroupAlone(Steps):
    """The steps of a render in which nothing shines but one group of lights, with some of its domes turned."""

    def __init__(self, group: Collection[str], domes: Collection[str], degrees: float) -> None:
        self._group, self._domes, self._degrees = group, domes, degrees

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        description = super().add_missing_light(description, textures, settings, diagnostics)
        turn = turn_about_up(self._degrees, description)
        lights = tuple(
            _turned(light, turn) if light.type is LightType.DOME and light.path in self._domes else light
            for light in description.lights
            if light.path in self._group
        )
        if all(light.type is not LightType.DOME or light.path not in self._domes for light in lights):
            message = "the stage has no dome of this name; only the turn of a dome can change after the render"
            raise SettingsError(message, where=", ".join(self._domes), code=CODE)
        return replace(without_emission(description, self._group), lights=lights)


def _turned(dome: Light, turn: Doubles) -> Light:
    motion = None if dome.motion is None else replace(dome.motion, matrices=turn @ dome.motion.matrices)
    return replace(dome, world_from_light=turn @ dome.world_from_light, motion=motion)


def settings_of_header(header: Mapping[str, str | int | float], resolution: tuple[int, int], spp: int | None) -> RenderSettings:
    """Return the settings that a picture's header tells, with outputs and stopping rules of the new render.

    `resolution` of the pixels that were rendered, which may be a region of the frame. Samples are those of the picture's range,
    if it has one, unless `spp` is given.
    """
    if "settings.camera" not in header or "samples" not in header:
        sentence = "the picture's header does not tell the settings of its render, with a camera of the stage"
        raise SettingsError(sentence, code=CODE)
    told = {row.name: header[f"settings.{row.name}"] for row in rows(RenderSettings) if f"settings.{row.name}" in header}
    try:
        values = {
            row.name: _value(row, told[row.name]) for row in rows(RenderSettings) if row.name in told and row.name not in OWN
        }
        asked = RenderSettings(**values)
        if spp is None and asked.sample_range is not None:
            return replace(asked, aovs=(LIGHTS,))
        width, height = resolution
        mean = max(round(int(header["samples"]) / (width * height)), 1)
        return replace(asked, aovs=(LIGHTS,), sample_range=None, spp=mean if spp is None else spp)
    except (TypeError, ValueError) as error:
        raise SettingsError(f"the picture's header has settings of another version: {error}", code=CODE) from None


def composition_of_header(header: Mapping[str, str | int | float]) -> RenderSettings:
    """Return the settings by which the stage of a picture was composed, as its header tells them; others are the defaults."""
    told = [(row, header.get(f"settings.{row.name}")) for row in rows(RenderSettings) if row.name in COMPOSING]
    return RenderSettings(**{row.name: _value(row, value) for row, value in told if value is not None})


def _value(row: Row, told: str | int | float) -> Any:
    """Return the value of a setting as `report.header_of` wrote it."""
    form = form_of(row)
    if told == "default" and row.default is None:
        return None
    if isinstance(row.read, choice):
        return row.read.kinds(told)
    if form is bool:
        return bool(int(told))
    if form in (int, float, str):
        return form(told)
    words = str(told).split()
    kinds = get_args(form)
    return words if form == list[str] else tuple(kind(word) for kind, word in zip(kinds, words, strict=True))
