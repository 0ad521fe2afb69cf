"""Surfaces as the core is given them: constants in place of what cannot be read, and OpenPBR's lobes."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace

import pytest
from tests.described import core_in_use

from primray.core.inputs import surface_input
from primray.core.surface_upload import with_constants, with_readable_inputs, without_pattern
from primray.description import (
    CameraVisibility,
    NodeOutput,
    OpenPbr,
    Pattern,
    PatternInput,
    PatternNode,
    PrimvarInput,
    Surface,
    TextureFile,
    TextureInput,
)

FILE = TextureFile("absent.png", "auto")
TEXTURE = TextureInput(FILE, "rgb", PrimvarInput("st", (0.0, 0.0)), fallback=(0.5, 0.25, 0.125, 1.0))
PATTERN = Pattern((PatternNode("tangent", "vector3", "ND_tangent_vector3", ()),))
TANGENT = ("tangent", PatternInput(NodeOutput(0), (1.0, 0.0, 0.0)))
LOBES = OpenPbr(coat_weight=0.5)


def core() -> SimpleNamespace:
    """One whose inputs take anything."""
    by_value = {visibility.value: visibility for visibility in CameraVisibility}
    return SimpleNamespace(
        SurfaceInput=lambda: SimpleNamespace(open_pbr=None), OpenPbrInput=SimpleNamespace, CameraVisibility=by_value
    )


def test_lobes_are_handed_over_by_their_names() -> None:
    with core_in_use(core()):
        made = surface_input(Surface("/m", opacity=0.5, open_pbr=LOBES))
    assert vars(made.open_pbr) == {f.name: getattr(LOBES, f.name) for f in fields(OpenPbr)}
    assert (made.opacity, hasattr(made, "inputs"), hasattr(made, "path")) == (0.5, False, False)


def test_other_surfaces_have_none() -> None:
    with core_in_use(core()):
        assert surface_input(Surface("/m")).open_pbr is None


def test_what_the_camera_sees_is_handed_over() -> None:
    with core_in_use(core()):
        for visibility in CameraVisibility:
            assert surface_input(Surface("/m", camera=visibility)).camera is visibility


def test_constants_take_their_place_among_the_lobes() -> None:
    inputs = (("open_pbr_base_color", TEXTURE), ("open_pbr_coat_roughness", TEXTURE), ("opacity", TEXTURE), ("normal", TEXTURE))
    three = (0.5, 0.25, 0.125)
    made = with_constants(Surface("/m", open_pbr=LOBES, inputs=inputs), {name: three for name, _ in inputs})
    assert made == Surface("/m", opacity=0.5, open_pbr=OpenPbr(base_color=three, coat_roughness=0.5, coat_weight=0.5))


def test_a_file_that_cannot_be_read_leaves_its_fallback() -> None:
    surface = Surface("/m", open_pbr=LOBES, inputs=(("open_pbr_fuzz_color", TEXTURE), TANGENT), pattern=PATTERN)
    made = with_readable_inputs(surface, {})
    assert made.open_pbr == OpenPbr(coat_weight=0.5, fuzz_color=(0.5, 0.25, 0.125))
    assert (made.inputs, made.pattern) == ((TANGENT,), PATTERN)


def test_without_its_pattern_the_tangent_is_the_shapes() -> None:
    reads = PatternInput(NodeOutput(0), (0.75,))
    surface = Surface("/m", open_pbr=LOBES, inputs=(("open_pbr_specular_roughness", reads), TANGENT), pattern=PATTERN)
    assert without_pattern(surface) == Surface("/m", open_pbr=OpenPbr(coat_weight=0.5, specular_roughness=0.75))


def test_names_of_lobes_are_of_surfaces_that_have_them() -> None:
    with pytest.raises(AttributeError):
        Surface("/m").constant("open_pbr_base_color")
