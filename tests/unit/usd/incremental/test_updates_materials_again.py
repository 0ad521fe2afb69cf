"""Edits of a material with OpenPBR's lobes: the kept translation is that of the stage as it is now."""

from __future__ import annotations

import pytest
from pxr import Sdf
from tests.unit.usd.material_text import material
from tests.unit.usd.usd_text import stage_of

from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.incremental import KeptTranslation, StageChanges

TEXT = """
    float inputs:base = 0.5
    float inputs:transmission = 0
    float inputs:coat = 0
    float inputs:emission = 0
    float inputs:specular_anisotropy = 0
    bool inputs:thin_walled = 0
"""
EDITS = {"base": 0.25, "transmission": 1.0, "coat": 1.0, "emission": 2.0, "specular_anisotropy": 0.5, "thin_walled": True}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_gives_what_a_new_translation_gives(name: str) -> None:
    stage = stage_of(material(TEXT, shader="ND_standard_surface_surfaceshader"))
    kept, changes, settings = KeptTranslation(), StageChanges(stage), RenderSettings()
    before, _ = kept.translate(stage, settings, changes.take())
    stage.GetAttributeAtPath(Sdf.Path(f"/m/s.inputs:{name}")).Set(EDITS[name])
    after, told = kept.translate(stage, settings, changes.take())
    expected, expected_told = translate(stage, settings)
    assert after.surfaces != before.surfaces
    assert (after.surfaces, list(told)) == (expected.surfaces, list(expected_told))
