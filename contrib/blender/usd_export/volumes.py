# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume shaders of Blender as MaterialX's volume: the exporter writes the grids of volumes, but none of their materials.

The coefficients are Cycles' (its kernel's svm/closure.h and svm/volume.h): rates per metre, times the grid that is the density.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

Note = Callable[[str, str, str], None]
Color = tuple[float, float, float]
BLACK: Color = (0.0, 0.0, 0.0)
STEFAN_BOLTZMANN = 5.670373e-8 * 1e-6 / 3.141592653589793  # as in Cycles' Principled Volume
DEEPEST = 8


@dataclass(frozen=True)
class Term:
    """Rates per metre of a volume, times a grid where `grid` names one. A black body is emission by a grid of temperatures."""

    absorption: Color = BLACK
    scattering: Color = BLACK
    anisotropy: float = 0.0
    emission: Color = BLACK
    grid: str = ""
    temperature: tuple[float, float, str, Color] | None = None  # intensity, factor of the grid (or kelvins), grid, tint

    def scaled(self, factor: float) -> Term:
        a, s, e = ([factor * value for value in rates] for rates in (self.absorption, self.scattering, self.emission))
        body = self.temperature
        if body is not None:
            body = (*body[:3], (body[3][0] * factor, body[3][1] * factor, body[3][2] * factor))
        return replace(self, absorption=_color(a), scattering=_color(s), emission=_color(e), temperature=body)


@dataclass
class Medium:
    terms: list[Term] = field(default_factory=list)
    droplets: float = 0.0  # micrometres


def medium_of(tree: Any, output_type: str, name: str, note: Note) -> Medium | None:
    """Return what a node tree's output says of a volume; None where it has none."""
    output = next((n for n in tree.nodes if n.type == output_type and n.is_active_output), None) if tree else None
    if output is None or not output.inputs["Volume"].is_linked:
        return None
    medium = Medium()
    medium.terms = _terms(output.inputs["Volume"].links[0].from_node, name, note, medium, 0)
    return medium


def _color(values: Any) -> Color:
    a, b, c = list(values)[:3]
    return float(a), float(b), float(c)


def _terms(node: Any, name: str, note: Note, medium: Medium, depth: int) -> list[Term]:
    def value(socket: str) -> float:
        found = node.inputs[socket]
        if found.is_linked:
            note("volume-nodes", name, f"what is linked to {socket} of {node.bl_label} is ignored: its own value is used")
        return float(found.default_value)

    def color(socket: str) -> Color:
        found = node.inputs[socket]
        if found.is_linked:
            note("volume-nodes", name, f"what is linked to {socket} of {node.bl_label} is ignored: its own value is used")
        return _color(found.default_value)

    def shader(index: int) -> list[Term]:
        socket = node.inputs[index]
        return _terms(socket.links[0].from_node, name, note, medium, depth + 1) if socket.is_linked else []

    match node.type:
        case "PRINCIPLED_VOLUME":
            return _principled(node, value, color, name, note)
        case "VOLUME_SCATTER":
            factor, grid = _product(node.inputs["Density"], name, note, 0)
            phase = _phase(node, value, name, note, medium)
            return [Term(scattering=color("Color"), anisotropy=phase, grid=grid).scaled(factor)]
        case "VOLUME_ABSORPTION":
            factor, grid = _product(node.inputs["Density"], name, note, 0)
            clear = [max(1 - channel, 0.0) for channel in color("Color")]
            return [Term(absorption=_color(clear), grid=grid).scaled(factor)]
        case "VOLUME_COEFFICIENTS":
            phase = _phase(node, value, name, note, medium)
            rates = [color(f"{kind} Coefficients") for kind in ("Absorption", "Scatter", "Emission")]
            return [Term(absorption=rates[0], scattering=rates[1], anisotropy=phase, emission=rates[2])]
        case "EMISSION":
            factor, grid = _product(node.inputs["Strength"], name, note, 0)
            return [Term(emission=color("Color"), grid=grid).scaled(factor)]
        case "ADD_SHADER" if depth < DEEPEST:
            return shader(0) + shader(1)
        case "MIX_SHADER" if depth < DEEPEST:
            share = value(node.inputs[0].name)
            return [term.scaled(1 - share) for term in shader(1)] + [term.scaled(share) for term in shader(2)]
    note("volume-nodes", name, f"{node.bl_label or node.type} is not exported as a volume")
    return []


def _principled(node: Any, value: Any, color: Any, name: str, note: Note) -> list[Term]:
    scattered, absorbed = color("Color"), color("Absorption Color")
    if node.inputs["Color Attribute"].default_value:
        note("volume-nodes", name, "the colour attribute of the Principled Volume is ignored")
    clear = [max(1 - c, 0.0) * max(1 - max(a, 0.0) ** 0.5, 0.0) for c, a in zip(scattered, absorbed, strict=True)]
    factor, grid = _product(node.inputs["Density"], name, note, 0)
    if grid and node.inputs["Density Attribute"].default_value:
        note("volume-nodes", name, "the density attribute of the Principled Volume is ignored, as another grid is linked")
    grid = grid or node.inputs["Density Attribute"].default_value
    rates = Term(absorption=_color(clear), scattering=scattered, anisotropy=value("Anisotropy"), grid=grid)
    found = [rates.scaled(max(factor, 0.0))]
    strength, intensity = max(value("Emission Strength"), 0.0), value("Blackbody Intensity")
    if strength > 1e-5:
        found.append(Term(emission=color("Emission Color")).scaled(strength))
    if intensity > 1e-3:
        kelvins, heat = value("Temperature"), node.inputs["Temperature Attribute"].default_value
        found.append(Term(temperature=(intensity, kelvins, heat, color("Blackbody Tint"))))
    return found


def _phase(node: Any, value: Any, name: str, note: Note, medium: Medium) -> float:
    """Return the mean cosine of a shader's phase function."""
    kind = getattr(node, "phase", "HENYEY_GREENSTEIN")
    if kind == "MIE":
        medium.droplets = value("Diameter")
    elif kind == "RAYLEIGH":
        note("volume-phase", name, "the phase function Rayleigh is rendered as an isotropic one")
        return 0.0
    elif kind != "HENYEY_GREENSTEIN":
        note("volume-phase", name, f"the phase function {kind.title()} is rendered as Henyey and Greenstein's")
    return value("Anisotropy") if kind != "MIE" else 0.0


def _product(socket: Any, name: str, note: Note, depth: int) -> tuple[float, str]:
    """Return a socket as a number times a grid ("": none): of attributes, Volume Info, and their products with numbers."""
    if not socket.is_linked:
        return float(socket.default_value), ""
    source = socket.links[0].from_socket
    node = source.node
    if node.type == "ATTRIBUTE" and source.name in ("Fac", "Factor"):
        return 1.0, node.attribute_name
    if node.type == "VOLUME_INFO" and source.name in ("Density", "Flame", "Temperature"):
        return 1.0, source.name.lower()
    if node.type == "VALUE":
        return float(source.default_value), ""
    if node.type == "MATH" and node.operation == "MULTIPLY" and depth < DEEPEST:
        (a, first), (b, second) = (_product(node.inputs[k], name, note, depth + 1) for k in (0, 1))
        if not (first and second):
            return a * b, first or second
    note("volume-nodes", name, f"{node.bl_label or node.type} is not exported in volumes: 1 is used for it")
    return 1.0, ""


def write_volumes(stage: Usd.Stage, scope: str, scene: Any, prims: dict[str, Sdf.Path], note: Note) -> None:
    """Write the volumes of materials, and bind them to grids and to meshes that have no surface."""
    for number, obj in enumerate(scene.objects):
        if obj.name not in prims or obj.type not in ("VOLUME", "MESH"):
            continue
        slots = [slot.material for slot in obj.material_slots if slot.material is not None]
        found = [(look, medium_of(look.node_tree, "OUTPUT_MATERIAL", look.name, note)) for look in slots]
        found = [(look, medium) for look, medium in found if medium is not None]
        if not found:
            continue
        look, medium = found[0]
        for prim in list(Usd.PrimRange(stage.GetPrimAtPath(prims[obj.name]))):
            if prim.GetTypeName() == "Volume":
                known = {name for name in prim.GetPropertyNames() if name.startswith("field:")}
                scaled = [term.scaled(_density(obj)) for term in medium.terms]
                terms = [_of_grids(term, known, look.name, note) for term in scaled]
                _bind(prim, _material(stage, f"{scope}/volume_{number}", terms, medium.droplets))
            elif prim.IsA(UsdGeom.Mesh):
                terms = [_of_grids(term, set(), "", note) for term in medium.terms]
                if _has_surface(look):
                    bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
                    _write(stage, bound, terms, medium.droplets)
                else:
                    _bind(prim, _material(stage, f"{scope}/volume_{number}", terms, medium.droplets))


def _has_surface(material: Any) -> bool:
    outputs = [node for node in material.node_tree.nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output]
    return any(node.inputs["Surface"].is_linked for node in outputs)


def _density(obj: Any) -> float:
    """Return the factor of a volume's rates: opacity keeps with the object's scale where its space is the object's (Cycles,
    ObjectManager)."""
    if obj.type != "VOLUME" or obj.data.render.space != "OBJECT":
        return 1.0
    from mathutils import Vector

    return 1.0 / max((obj.matrix_world.to_3x3() @ Vector((1, 1, 1)).normalized()).length, 1e-9)


def _of_grids(term: Term, known: set[str], name: str, note: Note) -> Term:
    """Return a term without grids that a volume does not have, as Blender's shaders ignore them."""
    if term.grid and f"field:{term.grid}" not in known:
        if name:
            note("volume-grid", name, f"there is no grid {term.grid}: the density is constant")
        term = replace(term, grid="")
    if term.temperature is not None and f"field:{term.temperature[2]}" not in known:
        term = replace(term, temperature=(*term.temperature[:2], "", term.temperature[3]))
    return term


def _bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def _material(stage: Usd.Stage, path: str, terms: list[Term], droplets: float) -> UsdShade.Material:
    material = UsdShade.Material.Define(stage, path)
    _write(stage, material, terms, droplets)
    return material


def _write(stage: Usd.Stage, material: UsdShade.Material, terms: list[Term], droplets: float) -> None:
    """Write MaterialX's volume as a material's."""
    nodes = _Nodes(stage, str(material.GetPath()))
    volume = nodes.new("ND_volume")
    vdfs = [nodes.vdf(term) for term in terms if any(term.absorption) or any(term.scattering)]
    edfs = [nodes.edf(term) for term in terms if any(term.emission) or term.temperature is not None]
    for name, closures in (("vdf", vdfs), ("edf", edfs)):
        if closures:
            total = closures[0]
            for one in closures[1:]:
                total = nodes.new(f"ND_add_{name}", in1=total, in2=one)
            nodes.connect(volume, name, total)
    material.CreateOutput("mtlx:volume", Sdf.ValueTypeNames.Token).ConnectToSource(nodes.output(volume))
    if droplets > 0:
        material.GetPrim().CreateAttribute("primray:volume:dropletDiameter", Sdf.ValueTypeNames.Float).Set(droplets)


class _Nodes:
    """Shaders below a material. An input is a number, three of them, a word, or another shader."""

    def __init__(self, stage: Usd.Stage, path: str) -> None:
        self._stage, self._path, self._count = stage, path, 0

    def new(self, kind: str, **inputs: Any) -> UsdShade.Shader:
        self._count += 1
        shader = UsdShade.Shader.Define(self._stage, f"{self._path}/volume_{self._count}")
        shader.CreateIdAttr(kind)
        for name, value in inputs.items():
            self.connect(shader, name, value)
        return shader

    def connect(self, shader: UsdShade.Shader, name: str, value: Any) -> None:
        types = Sdf.ValueTypeNames
        kinds = {
            "vdf": types.Token,
            "edf": types.Token,
            "vector3": types.Vector3f,
            "color3": types.Color3f,
            "float": types.Float,
        }
        if isinstance(value, UsdShade.Shader):
            made = next((kind for kind in kinds if self._kind(value).startswith(kind)), "float")
            shader.CreateInput(name, kinds[made]).ConnectToSource(self.output(value))
        elif isinstance(value, str):
            shader.CreateInput(name, types.String).Set(value)
        elif isinstance(value, tuple):
            is_color = "color" in shader.GetIdAttr().Get() or "edf" in shader.GetIdAttr().Get()
            kind = types.Color3f if is_color else types.Vector3f
            shader.CreateInput(name, kind).Set(Gf.Vec3f(*value))
        else:
            shader.CreateInput(name, types.Float).Set(float(value))

    def _kind(self, shader: UsdShade.Shader) -> str:
        kind = shader.GetIdAttr().Get()
        if kind.endswith(("vdf", "edf")) or "volume" in kind:
            return kind[-3:]
        return next((word for word in ("vector3", "color3") if word in kind), "color3" if "blackbody" in kind else "float")

    def output(self, shader: UsdShade.Shader) -> UsdShade.Output:
        types = Sdf.ValueTypeNames
        kind = {"vector3": types.Vector3f, "color3": types.Color3f, "float": types.Float}.get(self._kind(shader), types.Token)
        return shader.CreateOutput("out", kind)

    def grid(self, name: str) -> UsdShade.Shader:
        return self.new("ND_geompropvalue_float", geomprop=name)

    def rates(self, values: Color, grid: str) -> Any:
        return self.new("ND_multiply_vector3FA", in1=values, in2=self.grid(grid)) if grid else values

    def vdf(self, term: Term) -> UsdShade.Shader:
        rates = {"absorption": self.rates(term.absorption, term.grid), "scattering": self.rates(term.scattering, term.grid)}
        return self.new("ND_anisotropic_vdf", **rates, anisotropy=max(-0.98, min(term.anisotropy, 0.98)))

    def edf(self, term: Term) -> UsdShade.Shader:
        if term.temperature is not None:
            return self.new("ND_uniform_edf", color=self._black_body(*term.temperature))
        if not term.grid:
            return self.new("ND_uniform_edf", color=term.emission)
        return self.new("ND_uniform_edf", color=self.new("ND_multiply_color3FA", in1=term.emission, in2=self.grid(term.grid)))

    def _black_body(self, intensity: float, kelvins: float, grid: str, tint: Color) -> UsdShade.Shader:
        """Return the colour of a black body, as MaterialX and Cycles of a luminance of 1, times Stefan and Boltzmann's law."""
        heat = (
            self.new("ND_multiply_float", in1=self.grid(grid), in2=kelvins)
            if grid
            else self.new("ND_constant_float", value=kelvins)
        )
        law = self.new("ND_multiply_float", in1=self.new("ND_power_float", in1=heat, in2=4.0), in2=STEFAN_BOLTZMANN * intensity)
        law = self.new("ND_add_float", in1=law, in2=STEFAN_BOLTZMANN * (1 - intensity))
        color = self.new("ND_multiply_color3", in1=self.new("ND_blackbody", temperature=heat), in2=tint)
        return self.new("ND_multiply_color3FA", in1=color, in2=law)


def fog_of(medium: Medium, name: str, note: Note) -> dict[str, Any] | None:
    """Return a world's volume as attributes of primray's fog, whose extinction is grey; None, with a note, for others."""
    absorption = [sum(term.absorption[c] for term in medium.terms) for c in range(3)]
    scattering = [sum(term.scattering[c] for term in medium.terms) for c in range(3)]
    extinction = [a + s for a, s in zip(absorption, scattering, strict=True)]
    if max(extinction) <= 0:
        return None
    bodies = any(term.temperature is not None for term in medium.terms)
    if max(extinction) - min(extinction) > 1e-3 * max(extinction) or bodies:
        note("world-volume", name, "the world's volume is not rendered: its extinction is coloured, or it is a black body")
        return None
    weights = [sum(term.scattering) for term in medium.terms]
    mean = sum(w * term.anisotropy for w, term in zip(weights, medium.terms, strict=True)) / max(sum(weights), 1e-9)
    emission = [sum(term.emission[c] for term in medium.terms) for c in range(3)]
    return {
        "density": max(extinction),
        "color": _color([min(s / max(extinction), 0.99) for s in scattering]),
        "anisotropy": mean,
        "emission": _color(emission),
    }


def write_fog(stage: Usd.Stage, fog: dict[str, Any]) -> None:
    prim, types = stage.GetDefaultPrim(), Sdf.ValueTypeNames
    for name, value in fog.items():
        kind = types.Float if isinstance(value, float) else types.Color3f
        prim.CreateAttribute(f"primray:fog:{name}", kind).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)
