"""Arnold's surface shaders, each read into a KnownSurface (Arnold User Guide; arnold-usd's `arnold:` ids).

MaterialX's standard_surface comes from Arnold's, with the same names and defaults. A colour node that is bound as a surface
emits its colour, as in Arnold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

from ....description import NodeOutput, Operand
from ..materialx.definitions import InputDefinition, definition
from ..models import standard_surface, surface_nodes
from ..models.open_pbr import NORMAL, TANGENT, KnownSurface, Reader
from ..network import Node
from .arnold_nodes import NODES
from .arnold_patterns import PATTERNS
from .maths import BLACK, ONE, ZERO
from .values import ANY, RendererInputs, Vocabulary

_PREFIX = "arnold:"


def kind_of(node: Node) -> str:
    """Return a node's Arnold type, "" where it is not Arnold's."""
    return node.id.removeprefix(_PREFIX) if node.id.startswith(_PREFIX) else ""


def _inputs(n: RendererInputs, model: str) -> dict[str, Operand]:
    """Return the inputs of a model that Arnold and MaterialX have in common, by name."""
    found = definition(model)
    assert found is not None
    return {wanted.name: _input(n, wanted) for wanted in found.inputs}


def _input(n: RendererInputs, wanted: InputDefinition) -> Operand:
    """Return one input; zero vectors are the shape's own normal or tangent."""
    default = wanted.default
    if wanted.type == "vector3":
        value = n.vector(wanted.name, 0.0)
        if isinstance(value, NodeOutput):
            return value
        return TANGENT if "tangent" in wanted.name else NORMAL
    assert isinstance(default, tuple)
    return n.constants(wanted.name, *default) if wanted.type == "boolean" else n.operand(wanted.name, wanted.type, default)


def _standard_surface(n: RendererInputs) -> KnownSurface:
    inputs = _inputs(n, "ND_standard_surface_surfaceshader")
    if n.source("coat_normal") is None:
        inputs["coat_normal"] = inputs["normal"]
    return standard_surface.read(Reader(inputs, n.e))


def _openpbr_surface(n: RendererInputs) -> KnownSurface:
    inputs = _inputs(n, "ND_open_pbr_surface_surfaceshader")
    return surface_nodes.read_open_pbr(Reader(inputs, n.e))


def _lambert(n: RendererInputs) -> KnownSurface:
    return KnownSurface(
        base_weight=n.number("Kd", 0.7),
        base_color=n.color("Kd_color", 1.0),
        specular_weight=ZERO,
        opacity=n.reader.mean(n.color("opacity", 1.0)),
        normal=n.normal("normal"),
    )


def _standard(n: RendererInputs) -> KnownSurface:
    """Return Arnold 4's `standard` surface, with a diffuse and a glossy lobe."""
    glossy = n.number("Ks", 0.0)
    return KnownSurface(
        base_weight=n.number("Kd", 0.7),
        base_color=n.color("Kd_color", 1.0),
        base_diffuse_roughness=n.number("diffuse_roughness"),
        specular_weight=glossy,
        specular_color=n.color("Ks_color", 1.0),
        specular_roughness=n.number("specular_roughness", 0.466905),
        transmission_weight=n.number("Kt", 0.0),
        transmission_color=n.color("Kt_color", 1.0),
        specular_ior=n.number("IOR", 1.0) if n.number("Kt", 0.0) != ZERO else (1.5,),
        emission=n.reader.scaled(n.color("emission_color", 1.0), n.number("emission", 0.0)),
        opacity=n.reader.mean(n.color("opacity", 1.0)),
        normal=n.normal("normal"),
        near=("Ks",) if glossy != ZERO else (),
    )


def _utility(n: RendererInputs) -> KnownSurface:
    """Return `utility` with its colour unshaded, Lambertian or scaled by the facing ratio; its colour modes are ignored."""
    color = n.color("color", 1.0)
    if n.choice("color_mode", ("color",), "color") != "color":
        n.lost.add("color_mode")
    mode = n.choice("shade_mode", ("ndoteye", "lambert", "flat"), "ndoteye")
    if mode == "lambert":
        return KnownSurface(base_color=color, specular_weight=ZERO)
    if mode == "ndoteye":
        color = n.reader.scaled(color, n.e.apply("ND_facingratio_float"))
    return KnownSurface(unlit=True, emission=color)


def _matte(n: RendererInputs) -> KnownSurface:
    return KnownSurface(unlit=True, emission=n.color("color", 0.0), opacity=n.reader.mean(n.color("opacity", 1.0)))


def _of_input(*names: str) -> Callable[[RendererInputs], KnownSurface | None]:
    """Return a rule that reads the first of these inputs that is connected to a shader; the others are ignored."""

    def read(n: RendererInputs) -> KnownSurface | None:
        for name in names:
            found = n.shader(name)
            if found is not None:
                return n.values.surface(found)
            n.asked.discard(name)
        return None

    return read


def _two_sided(n: RendererInputs) -> KnownSurface | None:
    front, back = n.shader("front"), n.shader("back")
    if back is not None and (front is None or front.path != back.path):
        n.lost.add("back")
    return None if front is None else n.values.surface(front)


def _mix_shader(n: RendererInputs) -> KnownSurface | None:
    """Return a mixture of two surfaces, approximated by one surface with mixed inputs."""
    shaders = [n.shader(name) for name in ("shader1", "shader2")]
    made = [n.values.surface(shader) if shader is not None else None for shader in shaders]
    by = n.number("mix", 0.5)
    if n.choice("mode", ("blend", "add"), "blend") == "add":
        n.lost.add("mode")
    first, second = made
    if first is None or second is None or by in (ZERO, ONE):
        return first if second is None or by == ZERO else second
    n.near.add("mix")
    return mixed_surfaces(n, first, second, by)


def mixed_surfaces(n: RendererInputs, a: KnownSurface, b: KnownSurface, by: Operand) -> KnownSurface:
    """Return a surface whose inputs are interpolated between two; directions and switches are the first's."""
    made: dict[str, Operand] = {}
    for f in fields(KnownSurface):
        first, second = getattr(a, f.name), getattr(b, f.name)
        width = n.e.width(first) if isinstance(first, (tuple, NodeOutput)) else 0
        if width in (1, 3) and f.name not in ("unused", "near", "normal", "tangent", "coat_normal", "coat_tangent"):
            mix = n.reader.mixed if width == 1 else n.reader.mixed_colors
            made[f.name] = first if first == second else mix(first, second, by)
        elif first != second and f.name in ("normal", "coat_normal"):
            n.lost.add("shader2.normal")
    return replace(a, **made, unused=(*a.unused, *b.unused), near=(*a.near, *b.near))  # type: ignore[arg-type]


# Inputs that exporters write in addition to Arnold's own: a ramp's knots for a user interface.
_KNOTS = {f"ramp{i}{part}": ANY for i in range(1, 65) for part in ("c", "interp", "pos")}
_AOVS = {f"{name}{i}": ANY for i in range(1, 9) for name in ("aov_id", "id")}
NEUTRAL: dict[str, object] = {
    **_AOVS,
    **_KNOTS,
    **dict.fromkeys(
        ("r", "g", "b", "a", "rgb", "rgba", "float", "int", "x", "y", "z", "vector", "output"), ANY
    ),  # outputs that HtoA writes as inputs
    "name": ANY,
    "caustics": ANY,
    "transmit_aovs": ANY,
    "subsurface_type": ANY,
    "use_implicit_uvs": ANY,
    "filter_strength": ANY,
    "filter_offset": ANY,
    "indirect_diffuse": ONE,
    "indirect_specular": ONE,
    "internal_reflections": ONE,
    "exit_to_background": ZERO,
    "dielectric_priority": ZERO,
    "distortion": ZERO,
    "time": ZERO,
    "mode": "scalar",
    "P": BLACK,
    "pref_name": ANY,
    "tangent": BLACK,
    "overlay_mode": "none",
    "start_channel": ZERO,
}

VOCABULARY = Vocabulary(
    "Arnold",
    kind_of,
    {
        "standard_surface": _standard_surface,
        "openpbr_surface": _openpbr_surface,
        "lambert": _lambert,
        "standard": _standard,
        "utility": _utility,
        "matte": _matte,
        "two_sided": _two_sided,
        "mix_shader": _mix_shader,
        "ray_switch_shader": _of_input("camera", "diffuse_reflection", "specular_reflection"),
    },
    {**NODES, **PATTERNS},
    NEUTRAL,
    colors_shine=True,
)
