"""Translation of a UsdShadeMaterial to a Surface; each input of UsdPreviewSurface is a constant, primvar, texture or pattern.

A material with a surface shader that is not supported has no Surface: its shapes show their displayColor instead. `occlusion`
has no effect, since a path tracer computes what it approximates.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from pxr import Usd

from ...description import Input, PrimvarInput, Surface, TextureInput
from ...diagnostics import Diagnostic, Diagnostics
from ...settings import RenderContext
from ..scene.context import Context, MaterialKey
from ..scene.inheritance import Inherited
from ..scene.notes import RENDERERS, note_document, note_unknown_schemas
from ..stage.values import flag, number
from .authored import AuthoredPrim
from .material_primvars import COLOR_INPUTS, SURFACE_SHADERS
from .materialx.document_marks import NOTES
from .network import Constant, Network, Node, as_numbers, constant_color
from .node_values import FedInputs
from .surface_inputs import NO_PRIMVAR
from .translated_material import Material


@dataclass(frozen=True)
class _Slot:
    """A UsdPreviewSurface input that may vary: the Surface's field, its default and its range (the specification's)."""

    field: str
    default: tuple[float, ...]
    low: float = -math.inf
    high: float = math.inf


_SLOTS = {
    "diffuseColor": _Slot("diffuse_color", (0.18, 0.18, 0.18), 0.0, 1.0),
    "emissiveColor": _Slot("emissive_color", (0.0, 0.0, 0.0), 0.0, 1e30),  # the core's limit for textures
    "specularColor": _Slot("specular_color", (0.0, 0.0, 0.0), 0.0, 1.0),
    "metallic": _Slot("metallic", (0.0,), 0.0, 1.0),
    "roughness": _Slot("roughness", (0.5,), 0.0, 1.0),
    "clearcoat": _Slot("clearcoat", (0.0,), 0.0, 1.0),
    "clearcoatRoughness": _Slot("clearcoat_roughness", (0.01,), 0.0, 1.0),
    "opacity": _Slot("opacity", (1.0,), 0.0, 1.0),
    "ior": _Slot("ior", (1.5,), 0.0),
    "normal": _Slot("normal", (0.0, 0.0, 1.0)),
}
_DISPLACEMENT = "inputs:displacement"
_SURFACE = re.compile(r"outputs:.+:surface")
_OUTPUTS = {RenderContext.MTLX: ("mtlx:surface", "surface"), RenderContext.UNIVERSAL: ("surface", "mtlx:surface")}
HAIR = "primray:hair"  # UsdPreviewSurface's inputs describe hair (materials/hair.py)
PRIORITY = "primray:dielectric:priority"  # where dielectrics overlap, the one of higher priority fills the space
_OTHER_INPUTS = frozenset({"useSpecularWorkflow", "opacityMode", "opacityThreshold", "displacement", "occlusion"})


@dataclass
class _SurfaceInputs:
    """Inputs of the Surface found so far: constants, varying inputs, and the pattern nodes (`nodes`) that feed them."""

    constants: dict[str, tuple[float, ...]] = field(default_factory=dict)
    varying: dict[str, Input] = field(default_factory=dict)
    nodes: FedInputs | None = None


def translated_material(prim: Usd.Prim, bound_to: Inherited, ctx: Context) -> Material:
    """Return a translated material; it is translated once per set of colour scopes that instances pass to its prototype."""
    path = prim.GetPath()
    outer = bound_to.outer_colors if prim.IsInPrototype() else ()
    key = (path, outer)
    known = ctx.caches.materials
    if key not in known:
        known[key] = translate_uncached(key, ctx)
        ctx.diagnostics.extend(known[key][1])
    return known[key][0]


def translate_uncached(key: MaterialKey, ctx: Context) -> tuple[Material, list[Diagnostic]]:
    """Translate a material regardless of the cache; its diagnostics are returned, and not added to the context."""
    path, outer = key
    told = Diagnostics(ctx.diagnostics.shown)
    ctx = replace(ctx, outer_colors=outer, diagnostics=told)
    prim = ctx.stage.GetPrimAtPath(path)
    return (_translated(prim, ctx) if prim else Material(None)), list(told)


def _translated(prim: Usd.Prim, ctx: Context) -> Material:
    """Translate a material by a recipe that another left, else in full; it may leave one itself."""
    names, path = tuple(prim.GetAllChildrenNames()), ctx.shown(str(prim.GetPath()))
    recipes = ctx.caches.recipes.get(names)
    if recipes is None:
        ctx.caches.recipes[names] = []
        network = Network(ctx)
        return _translate(network, network.prim(prim), path, ctx)
    from .recipes import MOST, Recording  # imported where materials may be alike

    again: Iterator[Material | None] = (recipe.material(prim, ctx) for recipe in recipes if recipe is not None)
    if (found := next((made for made in again if made is not None), None)) is not None:
        return found
    recording = Recording() if len(recipes) < MOST else None
    network = Network(ctx, recording)
    material = network.prim(prim)
    made = _translate(network, material, path, ctx)
    if recording is not None:
        recipes.append(recording.recipe(network, material, made, ctx))
    return made


def _translate(network: Network, material: AuthoredPrim, path: str, ctx: Context) -> Material:
    """Translate the first surface output that leads to a supported shader.

    The settings decide whether MaterialX's output or the universal one is tried first; other renderers' outputs come last.
    """
    names = material.names  # GetSurfaceOutputs is twenty times slower
    if NOTES in names:
        note_document(material.prim, path, ctx)
    if any(name.endswith(":volume") for name in names):
        from ..volumes.in_shapes import is_volume_alone, volume_alone, with_volume

        if is_volume_alone(network, material):
            return volume_alone(network, material, path, ctx)
        made, shader = _surface(network, material, path, ctx)
        made = with_volume(made, network, material, path, ctx)
    else:
        made, shader = _surface(network, material, path, ctx)
    moves = any(name.endswith(":displacement") for name in names)
    if not moves and (shader is None or shader.id not in SURFACE_SHADERS or shader.shader.attribute(_DISPLACEMENT) is None):
        return made
    if made.surface is None:
        if moves:
            ctx.warn("displacement", path, "The surface shader is not supported: its displacement is ignored.")
        return made
    from .displacement import displaced

    return replace(made, surface=displaced(made.surface, network, material, shader, path, ctx))


def _surface(network: Network, material: AuthoredPrim, path: str, ctx: Context) -> tuple[Material, Node | None]:
    """Return the material without displacement, and its UsdPreviewSurface or MaterialX shader, if any."""
    prim, names = material.prim, material.names
    outputs = [name.removeprefix("outputs:") for name in names if name == "outputs:surface" or _SURFACE.fullmatch(name)]
    others, first = [], _OUTPUTS[ctx.settings.render_context]
    foreign: list[tuple[str, Node]] = []  # outputs with shaders of other renderers
    for output in sorted(outputs, key=lambda name: first.index(name) if name in first else len(first)):
        source = network.source(material.attribute(f"outputs:{output}"))
        if isinstance(source, Node):
            if source.id in SURFACE_SHADERS:
                _note_unread(outputs, output, path, ctx)
                if HAIR in names and flag(prim, HAIR, ctx.when, False, ctx.diagnostics):
                    from .hair import preview_hair

                    return Material(preview_hair(source, path, ctx)), None
                return _preview_surface(source, path, ctx), source
            if (made := _other_model(source, path, ctx)) is not None:
                _note_unread(outputs, output, path, ctx)
                return _with_priority(made, prim, ctx) if PRIORITY in names else made, source
            others.append(f"{source.id or source.shader.module or 'a shader without id'} at outputs:{output}")
            foreign.insert(
                len(foreign) if output in first else 0, (output, source)
            )  # a renderer's own output comes before the universal one
    if foreign and (made := _other_renderer(foreign, outputs, path, ctx)) is not None:
        return _with_priority(made, prim, ctx) if PRIORITY in names else made, None
    reason = (
        f"The surface shader is not supported ({', '.join(others)})" if others else "No surface output is connected to a shader"
    )
    ctx.warn("shader-ignored", path, f"{reason}: displayColor is used.", "outputs:surface")
    return Material(None), None


def _other_model(source: Node, path: str, ctx: Context) -> Material | None:
    """Return a material made from a MaterialX surface or a known MDL module, None for other shaders.

    Their modules are imported here, since most stages use neither.
    """
    if source.id.startswith("ND_"):
        if source.id == "ND_surface":
            from .hair import hair_bsdf, hair_surface

            bsdf = hair_bsdf(source)
            return None if bsdf is None else Material(hair_surface(bsdf, path, ctx))
        from .models.surface_nodes import known_material

        made = known_material(source, path, ctx)
        if made is not None:
            return made
    if source.shader.module:
        from .mdl.modules import mdl_material

        return mdl_material(source, path, ctx)
    return None


def _note_unread(outputs: list[str], used: str, path: str, ctx: Context) -> None:
    """Report the surface outputs for other renderers that a material is not made from."""
    for output in outputs:
        renderer = output.partition(":")[0]
        if output != used and renderer in RENDERERS:
            message = f"The output for {renderer} is ignored: the material is translated from outputs:{used}."
            ctx.warn("other-renderer", path, message, f"outputs:{output}")


def _other_renderer(shaders: list[tuple[str, Node]], outputs: list[str], path: str, ctx: Context) -> Material | None:
    """Return the first shader of another renderer that can be translated; the translation is imported only when needed."""
    if not ctx.settings.translated_shaders:
        return None
    from .other_renderers.translation import other_renderers_material

    for output, shader in shaders:
        if (made := other_renderers_material(shader, path, ctx)) is not None:
            _note_unread(outputs, output, path, ctx)
            return made
    return None


def _with_priority(made: Material, prim: Usd.Prim, ctx: Context) -> Material:
    """Return the material with the dielectric priority that its prim has."""
    if made.surface is None:
        return made
    priority = number(prim, PRIORITY, ctx.when, 0.0, ctx.diagnostics)
    return replace(made, surface=replace(made.surface, dielectric_priority=priority))


def _preview_surface(shader: Node, path: str, ctx: Context) -> Material:
    names = set(shader.shader.inputs)
    _note_inputs(shader, names, ctx)
    found = _SurfaceInputs()
    for name in (name for name in _SLOTS if name in names):
        _read_slot(shader, name, found, ctx)
    constants = found.constants
    threshold = _number(shader, "opacityThreshold", 0.0, ctx) if "opacityThreshold" in names else 0.0
    if "opacity" not in found.varying:
        if threshold > 0:  # a cut-out, whatever opacityMode: opaque from the threshold up, else invisible
            if constants.get("opacity", (1.0,))[0] < threshold:
                return Material(Surface(path), hidden=True)
            constants.pop("opacity", None)
        threshold = 0.0
    pattern, varying = (None, found.varying) if found.nodes is None else found.nodes.pattern_of(found.varying)
    mode = shader.parameter("opacityMode") if "opacityMode" in names else None
    workflow = shader.parameter("useSpecularWorkflow") if "useSpecularWorkflow" in names else None
    return Material(
        Surface(
            path,
            use_specular_workflow=workflow is not None and bool(workflow.value),
            presence=mode is not None and mode.value in ("presence", 1),  # in MaterialX the modes are integers
            opacity_threshold=max(threshold, 0.0),
            inputs=tuple(varying.items()),
            pattern=pattern,
            **{name: value[0] if len(value) == 1 else value for name, value in constants.items()},  # type: ignore[arg-type]
        )
    )


def _read_slot(shader: Node, name: str, found: _SurfaceInputs, ctx: Context) -> None:
    slot = _SLOTS[name]
    source = shader.source(name)
    if isinstance(source, Node):
        found.nodes = found.nodes or FedInputs(ctx)
        fed = found.nodes.read(shader, source, name, len(slot.default), is_color=name in COLOR_INPUTS)
        if fed is None:
            return
        if not isinstance(fed, tuple):
            found.varying[slot.field] = fed
            fed = _fallback_of(fed)
        if slot.field != "normal":
            found.constants[slot.field] = _clamped(fed, slot)
    elif source is not None:
        constant = _constant(shader, source, name, slot, ctx)
        if slot.field != "normal":
            found.constants[slot.field] = constant
        elif not any(constant):
            shader.warn("material-input", "normal has zero length and is ignored.", "inputs:normal")
        elif constant != slot.default:
            found.varying["normal"] = PrimvarInput(NO_PRIMVAR, constant)


def _fallback_of(made: Input) -> tuple[float, ...]:
    """Return the constant to use where neither the input's file nor its primvar exists."""
    if not isinstance(made, TextureInput):
        return made.fallback
    return _of_channels(made)


def _of_channels(made: TextureInput) -> tuple[float, ...]:
    return made.fallback[:3] if made.channels == "rgb" else (made.fallback["rgba".index(made.channels)],)


def _clamped(values: tuple[float, ...], slot: _Slot) -> tuple[float, ...]:
    """Return values clamped to the slot's range, one channel repeated where the field is a colour."""
    inside = tuple(min(max(x, slot.low), slot.high) for x in values)
    return inside * len(slot.default) if len(inside) == 1 else inside


def _constant(shader: Node, source: Constant, name: str, slot: _Slot, ctx: Context) -> tuple[float, ...]:
    values = as_numbers(source.value)
    if values is None or len(values) != len(slot.default):
        wanted = "a finite number" if len(slot.default) == 1 else f"{len(slot.default)} finite numbers"
        message = f"{name} = {source.value!r} is not {wanted}: {_shown(slot.default)} is used."
        shader.warn("wrong-type", message, f"inputs:{name}")
        return slot.default
    if name in COLOR_INPUTS:
        values = constant_color(values, source, ctx)
    inside = _clamped(values, slot)
    if inside != values:
        message = f"{name} = {_shown(values)} is outside [{slot.low:g}, {slot.high:g}] and is clamped."
        shader.warn("out-of-range", message, f"inputs:{name}")
    return inside


def _number(shader: Node, name: str, default: float, ctx: Context) -> float:
    """Return a constant float input of a shader, its default where the shader does not have it."""
    found = shader.parameter(name)
    if found is None:
        return default
    return _constant(shader, found, name, _Slot(name, (default,)), ctx)[0]


def _note_inputs(shader: Node, names: set[str], ctx: Context) -> None:
    """Report unknown schemas and unknown inputs of a shader."""
    note_unknown_schemas(shader.shader.prim, shader.shown, ctx)
    unknown = sorted(names - _SLOTS.keys() - _OTHER_INPUTS)
    for name in unknown:
        shader.warn("unknown-input", f"{shader.id} has no input {name}: it is ignored.", f"inputs:{name}")


def _shown(values: tuple[float, ...]) -> str:
    """Return values formatted for a message."""
    listed = ", ".join(f"{x:g}" for x in values)
    return listed if len(values) == 1 else f"({listed})"
