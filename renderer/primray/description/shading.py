"""The seam's surfaces: UsdPreviewSurface's inputs, or OpenPBR's, each a constant, a primvar, a texture or a pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from .hair import PREFIX as HAIR_PREFIX
from .hair import Hair
from .open_pbr import PREFIX, OpenPbr
from .patterns import Pattern, PatternInput
from .texture_file import TextureFile


class Wrap(Enum):
    """UsdUVTexture's wrapS and wrapT; USE_METADATA: as the file says, black where it says nothing."""

    USE_METADATA = "useMetadata"
    BLACK = "black"
    CLAMP = "clamp"
    REPEAT = "repeat"
    MIRROR = "mirror"


@dataclass(frozen=True)
class PrimvarInput:
    """The shape's or its instance's primvar of that name; `fallback` (1 to 4 floats) where there is none."""

    name: str
    fallback: tuple[float, ...]


@dataclass(frozen=True)
class TextureInput:
    """A UsdUVTexture's output: `channels` of texture(st') * scale + bias, where st' = st_transform * (st, 1).

    A file that cannot be read, or a tile of a set that is not there, gives `fallback` (scale and bias do not apply to it: the
    text multiplies texture values).
    (0, 0) is the image's lower left corner.
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

# What moves a surface before it is seen, in the units of the shape's own space: one number along the normal; three along the
# tangent of the primvar st, across it and along the normal; three along the axes of that space.
DISPLACEMENTS = ("displacement", "displacement_tangent", "displacement_object")


class CameraSight(Enum):
    """What the camera sees of a shape, straight or through what is see-through; anything else sees it in any case."""

    SEEN = "seen"
    HIDDEN = "hidden"  # what lies behind it
    MATTE = "matte"  # a hole in the picture: black, of alpha 0


@dataclass(frozen=True)
class Surface:
    """UsdPreviewSurface's inputs, a Lambert surface of `diffuse_color` (exactly albedo / pi), or the lobes of `open_pbr` or
    `hair`.

    The fields are constants. `inputs` names those that vary, by field name ("open_pbr_" or "hair_" and its name for one
    of theirs),
    "normal" (tangent space, -1 to 1; a pattern's is in world space) or "tangent" (of anisotropy: a pattern's, in world space);
    their constants then stand where nothing else is known. One of DISPLACEMENTS has none: it is there, or is not. `thin`: what
    is not opaque lets light straight through (else it refracts by its index; needs closed geometry).
    """

    path: str  # the material's prim path, "" for one made from displayColor
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
    opacity_threshold: float = 0.0  # above 0: opacity below it is a hole, else a whole surface (a cut-out)
    presence: bool = False  # opacityMode "presence": opacity scales everything, else it scales the diffuse part only
    ior: float = 1.5
    thin: bool = False
    dielectric_priority: float = 0.0  # of OpenPBR's bodies that overlap the higher one is there, of equals that entered last
    open_pbr: OpenPbr | None = None  # of a surface's other fields, emission, opacity and thin then have an effect
    hair: Hair | None = None  # likewise
    camera: CameraSight = CameraSight.SEEN
    inputs: tuple[tuple[str, Input], ...] = ()
    pattern: Pattern | None = None  # what its PatternInputs read

    @property
    def varying(self) -> frozenset[str]:
        """Names of inputs that are no constants."""
        return frozenset(name for name, _ in self.inputs)

    @property
    def displacement(self) -> tuple[str, Input] | None:
        """Which of DISPLACEMENTS moves it, and by what."""
        return next((item for item in self.inputs if item[0] in DISPLACEMENTS), None)

    def without_displacement(self) -> Surface:
        """What is left once shapes that wear it have been moved."""
        if self.displacement is None:
            return self
        left = tuple(item for item in self.inputs if item[0] not in DISPLACEMENTS)
        reads_pattern = any(isinstance(reads, PatternInput) for _, reads in left)
        return replace(self, inputs=left, pattern=self.pattern if reads_pattern else None)

    @property
    def transmits(self) -> bool:
        """Whether light goes through what is there of it."""
        if self.hair is not None:
            return False  # what passes comes out of the same fibre: no body is entered
        if self.open_pbr is not None:
            return self.open_pbr.transmission_weight > 0 or f"{PREFIX}transmission_weight" in self.varying
        return self.opacity < 1 or ("opacity" in self.varying and self.opacity_threshold == 0)

    @property
    def bends_nothing(self) -> bool:
        """Whether what it lets through goes straight on, and its two sides are as one."""
        lobes = self.open_pbr
        if lobes is None:
            return self.ior == 1 and "ior" not in self.varying
        names = ("specular_ior", "coat_weight", "subsurface_weight", "transmission_depth")
        at_rest = tuple(getattr(lobes, name) for name in names) == (1.0, 0.0, 0.0, 0.0)
        return at_rest and not any(PREFIX + name in self.varying for name in names)

    def constant(self, name: str) -> float | tuple[float, float, float]:
        """What stands for an input, by the name that it has among those that vary.

        Raises AttributeError for a surface that has no such input.
        """
        prefix, holder = next(((p, h) for p, h in self._lobes if name.startswith(p)), ("", self))
        value: float | tuple[float, float, float] = getattr(holder, name.removeprefix(prefix))
        return value

    @property
    def _lobes(self) -> tuple[tuple[str, Any], ...]:
        """Holders of inputs, by the prefixes of their names here."""
        return (PREFIX, self.open_pbr), (HAIR_PREFIX, self.hair)

    def with_constants(self, values: Mapping[str, float | tuple[float, float, float]]) -> Surface:
        """With these, by names as `constant` takes them."""
        own: dict[str, Any] = {name: v for name, v in values.items() if not name.startswith((PREFIX, HAIR_PREFIX))}
        for prefix, holder in self._lobes:
            lobes = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
            if lobes and holder is not None:
                own[prefix[:-1]] = replace(holder, **lobes)
        return replace(self, **own)
