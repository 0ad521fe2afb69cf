"""MaterialX surface shaders that are known by name, and the translation of a material that has one of them.

open_pbr_surface, whose inputs are those of KnownSurface, and surface_unlit are read here, other models in files of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields

from ....description import OpenPbr, Operand
from ...scene.context import Context
from ...scene.notes import note_unknown_schemas
from ..materialx.definitions import Definition
from ..materialx.expressions import MOST_NODES, Expressions, TooManyNodesError
from ..network import Node
from ..node_values import NodeValues, definition_of
from ..recipes import Recording
from ..translated_material import Material
from . import disney_principled, gltf_pbr, standard_surface
from .open_pbr import ONE, WHITE, ZERO, KnownSurface, Reader, as_open_pbr, is_cut_out

OPEN_PBR_SHADERS = ("ND_open_pbr_surface_surfaceshader",)
_OURS = ("coat_roughening",)
_GEOMETRY = ("opacity", "thin_walled", "normal", "tangent", "coat_normal", "coat_tangent")


def read_open_pbr(r: Reader) -> KnownSurface:
    """Return the surface that the inputs of the Academy Software Foundation's open_pbr_surface describe."""
    same = [f.name for f in fields(OpenPbr) if f.name not in _OURS]
    # The coat's colour is the square of its transmittance in one direction ("Coat", "Emission").
    through = r.expressions.apply("ND_power_color3FA", in1=r["coat_color"], in2=(0.5,))
    shining = r.scaled(r["emission_color"], r["emission_luminance"])
    return KnownSurface(
        **{name: r[name] for name in same},  # type: ignore[arg-type]
        **{name: r[f"geometry_{name}"] for name in _GEOMETRY},  # type: ignore[arg-type]
        emission=r.shining_through(shining, r["coat_weight"], through),
        called={name: f"geometry_{name}" for name in _GEOMETRY},
    )


UNLIT_SHADERS = ("ND_surface_unlit",)
_LEAST = (1e-3,)  # least opacity, so that a fully transmissive surface can still emit


def read_unlit(r: Reader) -> KnownSurface:
    """Return the surface that the inputs of MaterialX's surface_unlit describe: emission, and straight transmission."""
    emission, opacity = r.scaled(r["emission_color"], r["emission"]), r["opacity"]
    if r["transmission"] != ZERO:
        r.rest(transmission_color=WHITE)
        emission, opacity = _seen_through(r, emission)
    return KnownSurface(emission=emission, opacity=opacity, unlit=True, unused=tuple(r.unused))


def _seen_through(r: Reader, emission: Operand) -> tuple[Operand, Operand]:
    """Return emission and opacity for a transmission: less opacity, and more emission in return."""
    e = r.expressions
    kept = e.apply("ND_clamp_float", **{"in": r.one_minus(r["transmission"]), "low": _LEAST, "high": ONE})
    return e.apply("ND_divide_color3FA", in1=emission, in2=kept), r.times(r["opacity"], kept)


SURFACE_READERS: dict[str, Callable[[Reader], KnownSurface]] = {
    **dict.fromkeys(disney_principled.SHADERS, disney_principled.read),
    **dict.fromkeys(gltf_pbr.SHADERS, gltf_pbr.read),
    **dict.fromkeys(OPEN_PBR_SHADERS, read_open_pbr),
    **dict.fromkeys(standard_surface.SHADERS, standard_surface.read),
    **dict.fromkeys(UNLIT_SHADERS, read_unlit),
}


def known_material(shader: Node, path: str, ctx: Context) -> Material | None:
    """Return the material of a MaterialX surface shader, None where its definition is not a known surface."""
    found = definition_of(shader)
    if found is None or found.name not in SURFACE_READERS:
        return None
    note_unknown_schemas(shader.shader.prim, shader.shown, ctx)
    asked = shader.network.recording
    recording = asked if isinstance(asked, Recording) else None
    values = NodeValues(ctx) if recording is None else recording.values(ctx)
    try:
        given = values.inputs_of(shader, found)
        if recording is not None:
            recording.close(shader, found, given)
        made, told = material_of(found, given, values.expressions, path)
    except TooManyNodesError:
        ctx.warn("shader-ignored", path, f"Its network has more than {MOST_NODES:,} nodes: displayColor is used.")
        return Material(None)
    if told:
        shader.warn("material-input", told)
    if recording is not None:
        recording.material, recording.told = made, told
    return made


def material_of(found: Definition, given: Mapping[str, Operand], expressions: Expressions, path: str) -> tuple[Material, str]:
    """Return the material that a known surface's inputs describe, and what to report of them."""
    known = SURFACE_READERS[found.name](Reader({**found.default_operands, **given}, expressions))
    surface, told = as_open_pbr(known, expressions, path)
    return Material(surface, is_cut_out(known)), told.sentences()
