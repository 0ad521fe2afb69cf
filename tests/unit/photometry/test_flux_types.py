"""Photometry knows every type of light: an answer, or a refusal where a light has no surface of its own."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description.lighting import Light, LightType
from primray.photometry.flux import flux
from primray.photometry.illuminance import illuminance_ahead
from primray.photometry.light_shape import projected_area, shape_key

WITHOUT_SURFACE = {LightType.DISTANT, LightType.DOME, LightType.GEOMETRY}


def light_of(kind: LightType) -> Light:
    return Light("/light", kind, np.eye(4), (1.0, 1.0, 1.0), width=2.0, height=3.0, radius=0.7, length=4.0)


def shown(light: Light) -> float:
    linear, sizes = shape_key(light)
    directions = np.array([[0.0, 0.6, -0.8]])
    return float(projected_area(light.type, np.frombuffer(linear).reshape(3, 3), sizes, directions)[0])


@pytest.mark.parametrize("kind", LightType)
def test_every_type_is_answered_or_refused(kind: LightType) -> None:
    light = light_of(kind)
    asked = [lambda: float(flux(light)[0]), lambda: float(illuminance_ahead(light, 10.0)[0]), lambda: shown(light)]
    if kind in WITHOUT_SURFACE:
        for ask in asked:
            with pytest.raises(ValueError, match=f"a {kind.value} light has no surface"):
                ask()
    else:
        assert all(ask() > 0 for ask in asked)


def test_types_do_not_share_an_answer() -> None:
    kinds = [kind for kind in LightType if kind not in WITHOUT_SURFACE]
    assert len({round(float(flux(light_of(kind))[0]), 9) for kind in kinds}) == len(kinds)
    assert len({round(shown(light_of(kind)), 9) for kind in kinds}) == len(kinds)
