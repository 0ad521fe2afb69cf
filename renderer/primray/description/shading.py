"""The seam's surfaces: UsdPreviewSurface's inputs, each a constant, a primvar, a texture or a pattern."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

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


@dataclass(frozen=True)
class Surface:
    """UsdPreviewSurface's inputs, or a Lambert surface of `diffuse_color` (exactly albedo / pi).

    The fields are constants. `inputs` names those that vary, by field name, or "normal" (tangent space, -1 to 1; a pattern's is
    in world space); their constants then stand where nothing else is known. `thin`: what is not opaque lets light straight
    through (else it refracts by `ior`; needs closed geometry).
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
    inputs: tuple[tuple[str, Input], ...] = ()
    pattern: Pattern | None = None  # what its PatternInputs read
