"""The stock MDL modules by file name, and the translation of a material that uses one of them."""

from __future__ import annotations

from collections.abc import Callable

from ....description import Surface
from ...scene.context import Context
from ..known_surfaces.as_open_pbr import as_open_pbr, is_hole, told
from ..known_surfaces.record import KnownSurface
from ..network import Node, node_path
from ..node_values import NodeValues
from . import gltf_material, omni_glass, omni_pbr, omni_surface, preview_surface
from .inputs import AtRest, MdlInputs
from .module import module_of

_Read = Callable[[MdlInputs], KnownSurface]
_MODULES: dict[str, tuple[_Read, AtRest]] = {
    "OmniPBR.mdl": (omni_pbr.read, omni_pbr.AT_REST),
    "OmniPBR_Opacity.mdl": (omni_pbr.read, omni_pbr.AT_REST),
    "OmniPBR_ClearCoat.mdl": (omni_pbr.read, omni_pbr.AT_REST),
    "OmniPBR_ClearCoat_Opacity.mdl": (omni_pbr.read, omni_pbr.AT_REST),
    "OmniGlass.mdl": (omni_glass.read, omni_glass.AT_REST),
    "OmniGlass_Opacity.mdl": (omni_glass.read, omni_glass.AT_REST),
    "OmniSurface.mdl": (omni_surface.read, omni_surface.AT_REST),
    "OmniSurfaceBase.mdl": (omni_surface.read, omni_surface.AT_REST),
    "OmniSurfaceLite.mdl": (omni_surface.read, omni_surface.AT_REST),
    "OmniSurfaceLiteBase.mdl": (omni_surface.read, omni_surface.AT_REST),
    "OmniSurfacePresets.mdl": (omni_surface.read, omni_surface.AT_REST),
    "UsdPreviewSurface.mdl": (preview_surface.read, preview_surface.AT_REST),
    "gltf/pbr.mdl": (gltf_material.read, gltf_material.AT_REST),
    "pbr.mdl": (gltf_material.read, gltf_material.AT_REST),
}


def mdl_material(shader: Node, path: str, ctx: Context) -> tuple[Surface, bool] | None:
    """Return the surface and whether its cutoff removes all of it; None where the module is not a stock one."""
    module = module_of(shader)
    found = _MODULES.get(module) or _MODULES.get(module.rpartition("/")[2])
    if found is None:
        return None
    read, at_rest = found
    inputs = MdlInputs(shader, NodeValues(ctx))
    known = read(inputs)
    surface, not_had = as_open_pbr(known, inputs.expressions, path)
    sentences = told((*not_had.unused, *inputs.unread(at_rest)), not_had.near).sentences()
    message = f"{module.rpartition('/')[2]} is translated by its documented inputs, not interpreted. {sentences}".rstrip()
    ctx.warn("mdl-material", node_path(shader, ctx), message)
    return surface, is_hole(known)
