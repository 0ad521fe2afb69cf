"""Surfaces of a scene description: inputs of UsdPreviewSurface, OpenPBR or hair, each a constant, a primvar, a texture or an
output of a pattern (a graph of MaterialX's primitive nodes); and which primvars and texture files a pattern reads.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import Any

from ..color.color_space import REC709, ColorSpace


@dataclass(frozen=True)
class TextureFile:
    path: str  # resolved by Ar: a file, or "package.usdz[member]"; "" if nothing was found; with <UDIM> or <UVTILE> for a set
    color_space: str | ColorSpace  # "auto", "raw" (numbers), "sRGB", or a name that only the OCIO configuration defines
    tiles: tuple[tuple[int, str], ...] = ()  # of a <UDIM> path: (1001 ... 1100, resolved path)
    target: ColorSpace = REC709  # the rendering space, to which colours are converted
    is_color: bool = True  # else its three channels are numbers: transfer curves are undone, but channels never mixed
    layer: str = ""  # of a multi-part file: a part, or channels with that prefix; "": the default


UV_TEXTURE, TRANSFORM_2D = "UsdUVTexture", "UsdTransform2d"  # USD's own node categories

Value = tuple[
    float, ...
]  # one number for float, integer and boolean; one per component of vectors and colours; matrices by rows


@dataclass(frozen=True)
class NodeOutput:
    node: int  # index in Pattern.nodes, less than that of its reader
    output: str = "out"  # name in the node's definition


Operand = Value | NodeOutput | TextureFile | str  # a str is an enumerated choice, a space or the name of a primvar


@dataclass(frozen=True)
class PatternNode:
    """Primitive node of MaterialX's standard library (not implemented by a node graph), or one of USD's own: UsdTransform2d, or
    UsdUVTexture (`channels` of texels times scale plus bias; of its fallback if the file cannot be read).

    `inputs` has all inputs of its definition, with defaults filled in. Constant colours are in the rendering space.
    """

    category: str  # "multiply", "noise2d", "image" ...
    type: str  # of its first output: "float", "color3", "vector2" ...
    signature: str  # name of its definition, for nodes with mixed types: "ND_multiply_vector3FA"
    inputs: tuple[tuple[str, Operand], ...]
    path: str = ""  # of the prim or element that it comes from, for diagnostics


@dataclass(frozen=True)
class Pattern:
    """Nodes in topological order: each reads only earlier ones. Constant nodes have been folded."""

    nodes: tuple[PatternNode, ...]


@dataclass(frozen=True)
class PatternInput:
    """Surface input driven by an output of the surface's own pattern; `fallback` is used where a single number or colour is
    needed."""

    source: NodeOutput
    fallback: tuple[float, ...]


class Wrap(Enum):
    """Wrap modes (UsdUVTexture's wrapS and wrapT). USE_METADATA: as the file says, black if it does not."""

    USE_METADATA = "useMetadata"
    BLACK = "black"
    CLAMP = "clamp"
    REPEAT = "repeat"
    MIRROR = "mirror"


@dataclass(frozen=True)
class PrimvarInput:
    """Input that reads the primvar `name` of the shape or its instance; `fallback` (1 to 4 floats) if there is none."""

    name: str
    fallback: tuple[float, ...]


@dataclass(frozen=True)
class TextureInput:
    """Input that reads a UsdUVTexture: `channels` of texture(st') * scale + bias, where st' = st_transform * (st, 1).

    If the file cannot be read, or a tile of a set is missing, the value is `fallback` (without scale and bias: by the
    specification these apply to texture values). (0, 0) is the image's lower left corner.
    """

    file: TextureFile
    channels: str  # "rgb", or one of "r", "g", "b", "a"
    st: PrimvarInput
    st_transform: tuple[float, float, float, float, float, float] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # 2 x 3, by rows
    wrap_s: Wrap = Wrap.USE_METADATA
    wrap_t: Wrap = Wrap.USE_METADATA
    fallback: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    bias: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


Input = PrimvarInput | TextureInput | PatternInput

# Displacement inputs, in units of the shape's own space: one number along the normal; three along the tangent of the primvar
# st, the bitangent and the normal; three along the object axes.
DISPLACEMENTS = ("displacement", "displacement_tangent", "displacement_object")


class CameraVisibility(Enum):
    """Visibility of a shape to the camera, directly or through transparent surfaces; all other rays see it in any case."""

    SEEN = "seen"
    HIDDEN = "hidden"  # what is behind it is seen
    MATTE = "matte"  # holdout: black, with alpha 0


@dataclass(frozen=True, kw_only=True)
class HomogeneousVolume:
    """Medium inside a closed shape: coefficients per world unit of length, and radiance emitted per world unit of length.

    `path` is the shape's: each shape has a volume of its own, so that overlapping ones add.
    """

    path: str = ""
    extinction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scattering: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0  # mean cosine of the phase function (Henyey and Greenstein)
    droplets: float = 0.0  # diameter of water droplets in micrometres, whose phase function it has; 0: none


@dataclass(frozen=True)
class Surface:
    """Surface with UsdPreviewSurface's inputs, a Lambert surface of `diffuse_color` (exactly albedo / pi), or the lobes of
    `open_pbr` or `hair`.

    The fields are constants. `inputs` names those that vary, by field name ("open_pbr_" or "hair_" and the name for one of
    these), "normal" (tangent space, -1 to 1; from a pattern in world space) or "tangent" (for anisotropy, from a pattern, in
    world space); their constants are used where no other value is known. DISPLACEMENTS have no constant. `thin`: transmitted
    light is not refracted (else it refracts by the index of refraction, which needs closed geometry).
    """

    path: str  # of the material prim; "" for surfaces made from displayColor
    lambert: bool = False
    diffuse_color: tuple[float, float, float] = (0.18, 0.18, 0.18)
    emissive_color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    use_specular_workflow: bool = False
    specular_color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    metallic: float = 0.0
    roughness: float = 0.5
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.01
    opacity: float = 1.0
    opacity_threshold: float = 0.0  # above 0: cut-out, which is a hole where opacity is below it and opaque elsewhere
    presence: bool = False  # opacityMode "presence": opacity scales everything, else only the diffuse part
    ior: float = 1.5
    thin: bool = False
    dielectric_priority: float = (
        0.0  # of overlapping OpenPBR interiors the one with the higher priority applies; if equal, the last one entered
    )
    open_pbr: OpenPbr | None = None  # if set, of the other fields only emission, opacity and thin have an effect
    hair: Hair | None = None  # if set, of the other fields only emission, opacity and thin have an effect
    volume: HomogeneousVolume | None = None  # in place of what is inside by the lobes; only in closed shapes
    interface: bool = True  # without, the surface is not there, and only bounds its volume
    camera: CameraVisibility = CameraVisibility.SEEN
    inputs: tuple[tuple[str, Input], ...] = ()
    pattern: Pattern | None = None  # graph that its PatternInputs read

    @property
    def varying(self) -> frozenset[str]:
        """Names of the inputs that are not constant."""
        return frozenset(name for name, _ in self.inputs)

    @property
    def displacement(self) -> tuple[str, Input] | None:
        """Displacement input (one of DISPLACEMENTS) and its value, if any."""
        return next((item for item in self.inputs if item[0] in DISPLACEMENTS), None)

    def without_displacement(self) -> Surface:
        """Return the surface for shapes that have already been displaced."""
        if self.displacement is None:
            return self
        left = tuple(item for item in self.inputs if item[0] not in DISPLACEMENTS)
        reads_pattern = any(isinstance(reads, PatternInput) for _, reads in left)
        return replace(self, inputs=left, pattern=self.pattern if reads_pattern else None)

    @property
    def transmits(self) -> bool:
        """Whether light passes through the surface where it is present."""
        if self.hair is not None:
            return False  # transmitted light leaves the same fibre: no interior is entered
        if self.open_pbr is not None:
            return self.open_pbr.transmission_weight > 0 or f"{OPEN_PBR_PREFIX}transmission_weight" in self.varying
        return self.opacity < 1 or ("opacity" in self.varying and self.opacity_threshold == 0)

    @property
    def bends_nothing(self) -> bool:
        """Whether transmitted light continues straight on, and both sides behave the same."""
        lobes = self.open_pbr
        if lobes is None:
            return self.ior == 1 and "ior" not in self.varying
        names = ("specular_ior", "coat_weight", "subsurface_weight", "transmission_depth")
        at_rest = tuple(getattr(lobes, name) for name in names) == (1.0, 0.0, 0.0, 0.0)
        return at_rest and not any(OPEN_PBR_PREFIX + name in self.varying for name in names)

    def constant(self, name: str) -> float | tuple[float, float, float]:
        """Return the constant of an input, by its name in `inputs`.

        Raises AttributeError if the surface has no such input.
        """
        prefix, holder = next(((p, h) for p, h in self._lobes if name.startswith(p)), ("", self))
        value: float | tuple[float, float, float] = getattr(holder, name.removeprefix(prefix))
        return value

    @property
    def _lobes(self) -> tuple[tuple[str, Any], ...]:
        """Input holders with the prefixes of their names."""
        return (OPEN_PBR_PREFIX, self.open_pbr), (HAIR_PREFIX, self.hair)

    def with_constants(self, values: Mapping[str, float | tuple[float, float, float]]) -> Surface:
        """Return the surface with these constants, by the names that `constant` takes."""
        own: dict[str, Any] = {name: v for name, v in values.items() if not name.startswith((OPEN_PBR_PREFIX, HAIR_PREFIX))}
        for prefix, holder in self._lobes:
            lobes = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
            if lobes and holder is not None:
                own[prefix[:-1]] = replace(holder, **lobes)
        return replace(self, **own)


def volume_boundary(volume: HomogeneousVolume, path: str = "", camera: CameraVisibility = CameraVisibility.SEEN) -> Surface:
    """Return the surface of a closed shape that only bounds a volume; `path` is its material's."""
    return Surface(path, lambert=True, opacity=0.0, presence=True, thin=True, volume=volume, interface=False, camera=camera)


Color = tuple[float, float, float]
HAIR_PREFIX = "hair_"  # prefix of their names among a Surface's varying inputs


@dataclass(frozen=True, kw_only=True)
class Hair:
    """Constant inputs of the hair BSDF; varying ones are named in Surface.inputs, by PREFIX and name.

    R is reflection, TT transmission through the fibre, TRT one internal reflection.
    """

    absorption: Color = (0.0, 0.0, 0.0)  # per fibre radius
    tint_r: Color = (1.0, 1.0, 1.0)
    tint_tt: Color = (1.0, 1.0, 1.0)
    tint_trt: Color = (1.0, 1.0, 1.0)
    variance_r: float = 0.1  # longitudinal, in squared radians
    variance_tt: float = 0.1
    variance_trt: float = 0.1
    scale_r: float = 0.1  # azimuthal: scale of a logistic distribution, in radians
    scale_tt: float = 0.1
    scale_trt: float = 0.1
    ior: float = 1.55
    cuticle_tilt: float = 0.0  # radians


OPEN_PBR_PREFIX = "open_pbr_"  # prefix of their names among a Surface's varying inputs


@dataclass(frozen=True, kw_only=True)
class OpenPbr:
    """Constant inputs, with the defaults of OpenPBR Surface 1.1.1; varying ones are named in Surface.inputs, by PREFIX and
    name.

    Inputs that any surface has are fields of Surface: geometry_opacity is `opacity` with `presence` (or a threshold),
    geometry_thin_walled is `thin`, the product of the emission inputs is `emissive_color` (below coat and fuzz).
    """

    base_weight: float = 1.0
    base_color: Color = (0.8, 0.8, 0.8)
    base_diffuse_roughness: float = 0.0
    base_metalness: float = 0.0
    specular_weight: float = 1.0
    specular_color: Color = (1.0, 1.0, 1.0)
    specular_roughness: float = 0.3
    specular_roughness_anisotropy: float = 0.0
    specular_ior: float = 1.5
    transmission_weight: float = 0.0
    transmission_color: Color = (1.0, 1.0, 1.0)  # surface tint, or the colour of white light after transmission_depth
    transmission_depth: float = 0.0  # world units, like subsurface_radius; 0: tinted surface without an interior
    transmission_scatter: Color = (0.0, 0.0, 0.0)  # scattering coefficient times transmission_depth
    transmission_scatter_anisotropy: float = 0.0
    transmission_dispersion_scale: float = 0.0
    transmission_dispersion_abbe_number: float = 20.0
    subsurface_weight: float = 0.0
    subsurface_color: Color = (0.8, 0.8, 0.8)
    subsurface_radius: float = 1.0
    subsurface_radius_scale: Color = (1.0, 0.5, 0.25)
    subsurface_scatter_anisotropy: float = 0.0
    fuzz_weight: float = 0.0
    fuzz_color: Color = (1.0, 1.0, 1.0)
    fuzz_roughness: float = 0.5
    coat_weight: float = 0.0
    coat_color: Color = (1.0, 1.0, 1.0)
    coat_roughness: float = 0.0
    coat_roughness_anisotropy: float = 0.0
    coat_ior: float = 1.6
    coat_darkening: float = 1.0
    coat_roughening: float = 1.0  # not in OpenPBR: how much of the coat's roughness the base takes on; 1 as in OpenPBR
    thin_film_weight: float = 0.0
    thin_film_thickness: float = 0.5  # micrometres
    thin_film_ior: float = 1.4


COLOR_PRIMVAR = "displayColor"  # the primvar that geomcolor reads
# MaterialX's names of geometric properties that an input may have as its default: node category and space.
GEOMPROPS = {
    "UV0": ("texcoord", ""), "Pobject": ("position", "object"), "Pworld": ("position", "world"),
    "Nobject": ("normal", "object"), "Nworld": ("normal", "world"), "Tobject": ("tangent", "object"),
    "Tworld": ("tangent", "world"), "Bobject": ("bitangent", "object"), "Bworld": ("bitangent", "world"),
    "Vworld": ("viewdirection", "world"),
}  # fmt: skip
_BY_SET = {"texcoord": 2, "tangent": 2, "bitangent": 2}  # number of components, of nodes that read a set of texture coordinates
_READS_PRIMVARS = frozenset({*_BY_SET, "geomcolor", "geompropvalue"})
_CHANNELS = {"float": "r", "color4": "rgba", "vector4": "rgba"}


def primvar_of_set(index: int) -> str:
    """Return the primvar of a numbered set of texture coordinates."""
    return "st" if index == 0 else f"st{index}"


def pattern_primvars(pattern: Pattern) -> dict[str, int]:
    """Return the primvars that the pattern reads, with the number of components of each."""
    found: dict[str, int] = {}
    for node in pattern.nodes:
        for name, width in _primvars_of(node):
            found[name] = max(found.get(name, 0), width)
    return found


def pattern_fallbacks(pattern: Pattern, name: str) -> set[tuple[float, ...] | None]:
    """Return the values that nodes use if the primvar is missing; None for one computed by another node."""
    found: set[tuple[float, ...] | None] = set()
    for node in pattern.nodes:
        for width in (width for read, width in _primvars_of(node) if read == name):
            default = dict(node.inputs).get("default", (0.0,) * width) if node.category == "geompropvalue" else (0.0,) * width
            found.add(default if isinstance(default, tuple) else None)
    return found


def _primvars_of(node: PatternNode) -> list[tuple[str, int]]:
    found = [(primvar_of_set(0), 2) for _, v in node.inputs if type(v) is str and GEOMPROPS.get(v, ("", ""))[0] in _BY_SET]
    if node.category not in _READS_PRIMVARS:
        return found
    inputs = dict(node.inputs)
    if node.category in _BY_SET:
        index = inputs.get("index", (0.0,))
        found.append((primvar_of_set(int(index[0]) if isinstance(index, tuple) else 0), 2))
    if node.category == "geomcolor":
        found.append((COLOR_PRIMVAR, 4 if node.type == "color4" else 3))
    name = inputs.get("geomprop")
    if node.category == "geompropvalue" and isinstance(name, str) and name:
        found.append((name, int(node.type[-1]) if node.type[-1].isdigit() else 1))
    return found


def pattern_files(pattern: Pattern) -> dict[TextureFile, set[str]]:
    """Return the files that the pattern reads, with the channels of each, in order of use."""
    found: dict[TextureFile, set[str]] = {}
    for node in pattern.nodes:
        for _, value in node.inputs:
            if isinstance(value, TextureFile) and value.path:
                named = dict(node.inputs)["channels"] if node.category == UV_TEXTURE else None
                channels = named if isinstance(named, str) else _CHANNELS.get(node.type, "rgb")
                found.setdefault(value, set()).update(channels)
    return found


def without_images(surface: Surface) -> Surface:
    """Return the surface with the shading model's constants in place of all that image files decide; the same object if it
    reads none."""
    reads_files = surface.pattern is not None and bool(pattern_files(surface.pattern))
    gone = (TextureInput, PatternInput) if reads_files else (TextureInput,)
    names = [name for name, reads in surface.inputs if isinstance(reads, gone)]
    if not names:
        return surface
    left = tuple(item for item in surface.inputs if item[0] not in names)
    made = replace(surface, inputs=left, pattern=None if reads_files else surface.pattern)
    usual: dict[str, Any] = {f.name: f.default for f in fields(Surface)}
    for prefix, holder in surface._lobes:
        usual |= {} if holder is None else {prefix + f.name: f.default for f in fields(holder)}
    return made.with_constants({name: usual[name] for name in names if name in usual})


def plain_images(pattern: Pattern | None) -> Iterator[TextureInput]:
    """Yield the pattern's images whose coordinates are a primvar, not computed."""
    for node in pattern.nodes if pattern is not None else ():
        inputs = dict(node.inputs)
        file, name = inputs.get("file"), _coordinates_of(pattern, inputs)
        if isinstance(file, TextureFile) and name:
            yield TextureInput(file, "rgb", PrimvarInput(name, (0.0, 0.0)))


def _coordinates_of(pattern: Pattern | None, inputs: Mapping[str, object]) -> str:
    """Return the primvar with an image's coordinates, or "" if they are computed."""
    given = inputs.get("texcoord", inputs.get("st", "UV0"))
    if isinstance(given, NodeOutput) and pattern is not None:
        node = pattern.nodes[given.node]
        read = _primvars_of(node) if node.category in ("texcoord", "geompropvalue") else []
        return read[0][0] if read and read[0][1] == 2 else ""
    return primvar_of_set(0) if given == "UV0" else ""


def reads_world_space(pattern: Pattern, node: int) -> bool:
    """Return whether a node's outputs depend on the shape's placement in the world."""
    return any(
        type(value) is str and (value == "world" or GEOMPROPS.get(value, ("", ""))[1] == "world")
        for above in nodes_above(pattern, node)
        for _, value in above.inputs
    )


def reads_view(pattern: Pattern, node: int) -> bool:
    """Return whether a node's outputs depend on the direction from which they are seen."""
    return any(
        above.category == "viewdirection"
        or any(type(v) is str and GEOMPROPS.get(v, ("", ""))[0] == "viewdirection" for _, v in above.inputs)
        for above in nodes_above(pattern, node)
    )


def nodes_above(pattern: Pattern, node: int) -> list[PatternNode]:
    """Return the node and all nodes upstream of it."""
    found: set[int] = set()
    left = [node]
    while left:
        number = left.pop()
        if number not in found:
            found.add(number)
            left += [v.node for _, v in pattern.nodes[number].inputs if isinstance(v, NodeOutput)]
    return [pattern.nodes[number] for number in sorted(found)]
