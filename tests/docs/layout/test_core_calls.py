"""A gate: no positional call into the core with more than four arguments; and what must be the same on both sides is."""

from __future__ import annotations

import pytest

from primray import core
from primray.core.inputs import filled
from primray.description import Interpolation, LightType, Wrap
from primray.render.prepare import FILM_PIXEL_BYTES

from .core_calls import long_calls, long_calls_of_product


def test_no_call_into_the_core_has_more_than_four_positional_arguments() -> None:
    assert long_calls_of_product() == []


def test_a_long_call_is_found() -> None:
    assert list(long_calls("compiled.render_pass(a, b, c, d, e)")) == ["1: compiled.render_pass"]
    assert list(long_calls("compiled.render_pass(a, b, c, d, lanes=e)")) == []


def test_a_field_that_a_structure_lacks_is_an_error() -> None:
    for made in (core.module().CameraInput(), core.module().MeshInput(), core.module().IntegratorSettings()):
        with pytest.raises(AttributeError):
            filled(made, color=1)


def test_what_descriptions_name_the_core_knows_by_the_same_name() -> None:
    """The two sides have enumerations of their own: a description is without the core. What varies is diced before."""
    module = core.module()
    # Emission in grids is a light to the core alone.
    assert {light.name for light in LightType} | {"VOLUME"} == set(module.LightType.__members__)
    assert {wrap.name for wrap in Wrap} - {"USE_METADATA"} == set(module.Wrap.__members__)
    assert {interpolation.name for interpolation in Interpolation} - {"VARYING"} == set(module.PrimvarKind.__members__)


def test_sizes_are_those_of_the_core() -> None:
    """They are asked where the module has not been loaded yet."""
    assert (core.TILE, FILM_PIXEL_BYTES) == (core.module().TILE, core.module().FILM_PIXEL_BYTES)
