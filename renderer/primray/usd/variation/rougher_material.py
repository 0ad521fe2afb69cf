"""A material made rougher for a trial, in a stage's session layer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pxr import Sdf, Usd, UsdShade

from ..stage.layer_copy import restored
from ..stage.messages import scene_errors
from ..stage.reads import computed, default_value, shader_id
from ..stage.time_varying import has_time_values
from ..stage.traversal import find_below

ROUGHNESS = ("roughness", "specular_roughness", "coat_roughness", "clearcoatRoughness")  # of lobes that reflect or refract
_DIFFUSE = ("oren_nayar", "burley", "sheen", "subsurface")  # shaders whose roughness is of another kind


def can_be_rougher(stage: Usd.Stage, path: str, roughness: float) -> bool:
    """Return whether the prim is a material with a roughness below `roughness` that no texture and no time gives."""
    return bool(_smooth(stage, path, roughness))


@contextmanager
def rougher_material(stage: Usd.Stage, path: str, roughness: float) -> Iterator[None]:
    """Raise what a material has of roughness to `roughness` while the block runs."""
    session = stage.GetSessionLayer()
    with restored(session):
        with scene_errors(), Usd.EditContext(stage, session):
            for attribute in _smooth(stage, path, roughness):
                attribute.Set(roughness)
        yield


def _smooth(stage: Usd.Stage, path: str, roughness: float) -> list[Usd.Attribute]:
    material = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if not material or not material.IsA(UsdShade.Material) or material.IsInstanceProxy():
        return []
    found: dict[Sdf.Path, Usd.Attribute] = {}
    for prim in find_below(material):
        if prim.IsA(UsdShade.Shader) and not any(name in shader_id(prim) for name in _DIFFUSE):
            for name in ROUGHNESS:
                found |= {one.GetPath(): one for one in _givers(prim, name) if _is_below(one, roughness)}
    return list(found.values())


def _givers(shader: Usd.Prim, name: str) -> list[Usd.Attribute]:
    """Return the attributes that give an input its value: its own, or the material's input that it is connected to."""
    given = UsdShade.Shader(shader).GetInput(name)
    nothing: list[Usd.Attribute] = []
    sources = computed(given.GetValueProducingAttributes, nothing) if given else nothing
    return [one for one in sources if UsdShade.Input.IsInput(one) and not one.GetPrim().IsInstanceProxy()]


def _is_below(attribute: Usd.Attribute, roughness: float) -> bool:
    value = default_value(attribute)
    return isinstance(value, float) and value < roughness and not has_time_values(attribute)
