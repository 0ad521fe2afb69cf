"""Mixes of lights whose error a render stops at, as what each adds of the light path expressions of the film."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..aovs import LIGHTS, AovRequest, light_path_of
from ..arrays import Doubles
from ..errors import SettingsError, did_you_mean
from ..settings import RenderSettings, StopAt
from ..settings.light_mixes import weights_of_text


def mix_weights(settings: RenderSettings, requests: Sequence[AovRequest], expressions: Sequence[str]) -> Doubles | None:
    """Return what each mix adds of each expression's light (M, E, 3): its weight less 1. None if no mix decides.

    `requests` are the outputs of the render, those of lights already apart. SettingsError if there are none, or a mix names a
    light that has no output of its own.
    """
    if settings.stop_at is not StopAt.MIX:
        return None
    apart = {request.name: str(light_path_of(request.source)) for request in requests if request.name.startswith(f"{LIGHTS}.")}
    places = {name.removeprefix(f"{LIGHTS}."): expressions.index(source) for name, source in apart.items()}
    if not places:
        sentence = "the error of a mix of lights needs the light of each light: render it with --aov lights"
        raise SettingsError(sentence, where="stop_at", code="lights-missing")
    found = np.zeros((len(settings.mixes), len(expressions), 3))
    for number, text in enumerate(settings.mixes):
        for name, weight in weights_of_text(text).items():
            if name not in places:
                near = did_you_mean(name, list(places))
                has = f"{near + ' The' if near else 'the'} stage has {', '.join(places)}"
                raise SettingsError(f"there is no light {name!r} to weigh; {has}", where="mixes", code="lights-unknown")
            found[number, places[name]] = np.array(weight) - 1
    return found
