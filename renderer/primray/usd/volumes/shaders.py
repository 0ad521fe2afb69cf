"""Volume shaders of MaterialX and Karma, and Storm's fallback where a Volume has no material with one.

MaterialX (Specification, "PBR Shading Nodes"): `volume` has a VDF and an EDF; absorption and scattering are rates per metre,
emission is radiance per metre and not multiplied by them. Fields are read by `geompropvalue`, whose geomprop is the name of the
relationship `field:NAME`, or by UsdPrimvarReader. Karma's `kma_volume` has the inputs of an anisotropic VDF and a uniform EDF.
Storm (fallbackVolume.glslfx): extinction is the field density per scene unit, the albedo 0.18, and a field emission is added.
"""

from __future__ import annotations

from collections.abc import Callable

from pxr import Usd

from ...description import Operand
from ..materials.authored import INPUT, AuthoredPrim
from ..materials.materialx.definitions import definition
from ..materials.materialx.expressions import Expressions, TooManyNodesError
from ..materials.network import Network, Node
from ..materials.node_values import NodeValues
from ..scene.context import Context
from ..stage.metadata import meters_per_unit
from .coefficients import BLACK, Arithmetic, Coefficients, Lobe, UnusableShaderError, Vdf
from .fields import Field

DENSITY, EMISSION, TEMPERATURE = "density", "emission", "temperature"
STORM_ALBEDO = 0.18
_OUTPUTS = ("outputs:mtlx:volume", "outputs:volume", "outputs:kma:volume", "outputs:karma:volume")
_OTHER_OUTPUTS = ("outputs:arnold:volume", "outputs:ri:volume")
_KARMA = ("kma_volume", "ND_kma_volume")
_DEEPEST = 100  # nested VDFs


def coefficients_of(material: Usd.Prim | None, fields: dict[str, Field], path: str, ctx: Context) -> Coefficients:
    """Return the coefficients of a Volume whose material is `material`; faults are reported at the shaders and at `path`."""
    if material is None:
        return storm_fallback(fields, "no material is bound to it")
    network = Network(ctx)
    own = network.prim(material)
    made = first_coefficients(network, own, fields, ctx)
    if made is not None:
        return made
    which = "its material has no volume shader that is supported"
    return storm_fallback(fields, which if volume_shaders(network, own) else "its material has no volume output")


def first_coefficients(
    network: Network, material: AuthoredPrim, fields: dict[str, Field] | None, ctx: Context
) -> Coefficients | None:
    """Return the coefficients of the first shader of a material's volume outputs that is supported; others are reported.

    `fields`: None in shapes, which have none.
    """
    for source in volume_shaders(network, material):
        try:
            made = _read(source, fields, ctx)
        except UnusableShaderError as error:
            source.warn("shader-ignored", f"The volume shader cannot be rendered: {error}.")
            continue
        except TooManyNodesError:
            source.warn("shader-ignored", "The volume shader has too many nodes.")
            continue
        if made is not None:
            return made
        what = source.id or "a shader without id"
        source.warn("shader-ignored", f"{what} is not a supported volume shader.")
    return None


def volume_shaders(network: Network, material: AuthoredPrim) -> list[Node]:
    """Return the shaders of a material's volume outputs, those of universal ones first, without repetition."""
    found: dict[object, Node] = {}
    for name in (*_OUTPUTS, *_OTHER_OUTPUTS):
        source = network.source(material.attribute(name)) if name in material.names else None
        if isinstance(source, Node):
            found.setdefault(source.path, source)
    return list(found.values())


def _read(source: Node, fields: dict[str, Field] | None, ctx: Context) -> Coefficients | None:
    """Return what a volume shader says, None for one that is not known."""
    if source.id in ("ND_volume", "ND_volume_volumeshader"):
        return _materialx(source, ctx)
    if source.id in _KARMA:
        return _karma(source, ctx)
    from .other_renderers import other_coefficients

    return other_coefficients(source, fields, ctx)


def storm_fallback(fields: dict[str, Field], why: str) -> Coefficients:
    """Return Storm's fallback: extinction is the field density, the albedo 0.18; a field emission is added."""
    e = Expressions()
    a = Arithmetic(e)
    lobes: tuple[Lobe, ...] = ()
    absorption = emission = BLACK
    density = density_name(fields)
    said = f"Storm's convention is used, as {why}: "
    if density is None:
        said += "no field is its density"
    else:
        value = a.field(density)
        absorption = a.product(value, (1.0 - STORM_ALBEDO,))
        lobes = (Lobe(a.product(value, (STORM_ALBEDO,)), (0.0,)),)
        said += f"extinction is the field {density} per scene unit, with an albedo of {STORM_ALBEDO:g}"
    if EMISSION in fields and density != EMISSION:
        kind = "color3" if fields[EMISSION].grid.width == 3 else "float"
        emission = a.color(a.field(EMISSION, kind, (0.0,) * fields[EMISSION].grid.width))
        said += ", and the field emission is added"
    return Coefficients(expressions=e, convention=f"{said}.", absorption=absorption, lobes=lobes, emission=emission)


def density_name(fields: dict[str, Field]) -> str | None:
    """Return the name of the field that is a density: "density", or the only one that has one number a voxel."""
    if DENSITY in fields:
        return DENSITY
    named = [name for name, field in fields.items() if field.grid_name == DENSITY]
    if named:
        return named[0]
    scalar = [name for name, field in fields.items() if field.grid.width == 1 and name not in (EMISSION, TEMPERATURE)]
    return scalar[0] if len(scalar) == 1 else None


def _karma(source: Node, ctx: Context) -> Coefficients:
    values = NodeValues(ctx)
    a = Arithmetic(values.expressions)
    known = ("absorption", "scattering", "anisotropy", "emission")

    def given(name: str, width: int, default: Operand) -> Operand:
        return input_of(values, source, name, width, default)

    for name in sorted(set(source.shader.inputs) - set(known)):
        source.warn("material-input", f"{name} of {source.id} has no effect.", INPUT + name)
    lobe = Lobe(given("scattering", 3, BLACK), given("anisotropy", 1, (0.0,)))
    scale = meters_per_unit(ctx.stage)
    return Coefficients(
        expressions=a.e,
        convention=f"Karma's volume shader is used: its rates are per metre, and a scene unit is {scale:g} m.",
        absorption=given("absorption", 3, BLACK),
        lobes=(lobe,),
        emission=given("emission", 3, BLACK),
        per_scene_unit=scale,
    )


def input_of(values: NodeValues, node: Node, name: str, width: int, default: Operand) -> Operand:
    """Return an input of a shader that has no definition, as `width` numbers."""
    source = node.source(name)
    if source is None:
        return default
    if isinstance(source, Node):
        found = values.output(source, width, node, name, is_color=width == 3)
        return default if found is None else found
    return node.numbers(name, default, is_color=False) if isinstance(default, tuple) else default


def _materialx(source: Node, ctx: Context) -> Coefficients:
    values = NodeValues(ctx)
    reader = _Closures(values)
    vdf, edf = source.source("vdf"), source.source("edf")
    absorbed = reader.vdf(vdf) if isinstance(vdf, Node) else Vdf()
    emission = reader.edf(edf) if isinstance(edf, Node) else BLACK
    scale = meters_per_unit(ctx.stage)
    return Coefficients(
        expressions=values.expressions,
        convention=f"MaterialX's volume is used: its rates are per metre, and a scene unit is {scale:g} m.",
        absorption=absorbed.absorption,
        lobes=absorbed.lobes,
        emission=emission,
        per_scene_unit=scale,
    )


class _Closures:
    """MaterialX's VDFs and EDFs as operands."""

    def __init__(self, values: NodeValues) -> None:
        self._values, self._a = values, Arithmetic(values.expressions)
        self._depth = 0

    def _inputs(self, node: Node) -> dict[str, Operand]:
        found = definition(node.id)
        if found is None:
            raise UnusableShaderError(f"{node.id or 'a shader without id'} is unknown")
        given = self._values.inputs_of(node, found)
        return {**found.default_operands, **given}

    def _closure(self, node: Node, name: str, read: Callable[[Node], object]) -> object | None:
        source = node.source(name)
        return read(source) if isinstance(source, Node) else None

    def _below(self) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise UnusableShaderError(f"its closures are nested or connected more than {_DEEPEST} times")

    def vdf(self, node: Node) -> Vdf:
        self._below()
        a = self._a
        if node.id == "ND_absorption_vdf":
            return Vdf(a.color(self._inputs(node)["absorption"]))
        if node.id == "ND_anisotropic_vdf":
            given = self._inputs(node)
            return Vdf(a.color(given["absorption"]), (Lobe(a.color(given["scattering"]), given["anisotropy"]),))
        if node.id == "ND_add_vdf":
            return a.added(self._vdf_input(node, "in1"), self._vdf_input(node, "in2"))
        if node.id == "ND_mix_vdf":
            mix = self._inputs(node)["mix"]
            fg, bg = self._vdf_input(node, "fg"), self._vdf_input(node, "bg")
            return a.added(a.scaled(fg, mix), a.scaled(bg, a.complement(mix)))
        if node.id in ("ND_multiply_vdfC", "ND_multiply_vdfF"):
            return a.scaled(self._vdf_input(node, "in1"), self._inputs(node)["in2"])
        raise UnusableShaderError(f"{node.id or 'a shader without id'} is not a volume distribution function")

    def _vdf_input(self, node: Node, name: str) -> Vdf:
        source = node.source(name)
        return self.vdf(source) if isinstance(source, Node) else Vdf()

    def edf(self, node: Node) -> Operand:
        self._below()
        a = self._a
        if node.id == "ND_uniform_edf":
            return a.color(self._inputs(node)["color"])
        if node.id == "ND_add_edf":
            return a.sum(self._edf_input(node, "in1"), self._edf_input(node, "in2"))
        if node.id == "ND_mix_edf":
            mix = self._inputs(node)["mix"]
            fg, bg = self._edf_input(node, "fg"), self._edf_input(node, "bg")
            return a.sum(a.product(fg, mix), a.product(bg, a.complement(mix)))
        if node.id in ("ND_multiply_edfC", "ND_multiply_edfF"):
            return a.product(self._edf_input(node, "in1"), self._inputs(node)["in2"])
        raise UnusableShaderError(f"{node.id or 'a shader without id'} is not an emission of volumes that is supported")

    def _edf_input(self, node: Node, name: str) -> Operand:
        source = node.source(name)
        return self.edf(source) if isinstance(source, Node) else BLACK
