"""Surfaces of a scene description: inputs of UsdPreviewSurface, OpenPBR or hair, each a constant, a primvar, a texture or a
pattern."""

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


class CameraSight(Enum):
    """Visibility of a shape to the camera, directly or through transparent surfaces; all other rays see it in any case."""

    SEEN = "seen"
    HIDDEN = "hidden"  # what is behind it is seen
    MATTE = "matte"  # holdout: black, with alpha 0


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
    camera: CameraSight = CameraSight.SEEN
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
            return self.open_pbr.transmission_weight > 0 or f"{PREFIX}transmission_weight" in self.varying
        return self.opacity < 1 or ("opacity" in self.varying and self.opacity_threshold == 0)

    @property
    def bends_nothing(self) -> bool:
        """Whether transmitted light continues straight on, and both sides behave the same."""
        lobes = self.open_pbr
        if lobes is None:
            return self.ior == 1 and "ior" not in self.varying
        names = ("specular_ior", "coat_weight", "subsurface_weight", "transmission_depth")
        at_rest = tuple(getattr(lobes, name) for name in names) == (1.0, 0.0, 0.0, 0.0)
        return at_rest and not any(PREFIX + name in self.varying for name in names)

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
        return (PREFIX, self.open_pbr), (HAIR_PREFIX, self.hair)

    def with_constants(self, values: Mapping[str, float | tuple[float, float, float]]) -> Surface:
        """Return the surface with these constants, by the names that `constant` takes."""
        own: dict[str, Any] = {name: v for name, v in values.items() if not name.startswith((PREFIX, HAIR_PREFIX))}
        for prefix, holder in self._lobes:
            lobes = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
            if lobes and holder is not None:
                own[prefix[:-1]] = replace(holder, **lobes)
        return replace(self, **own)
