"""AOVs: the outputs beside the picture, by name; this is the only table of their channels and meanings.

AOVs are point samples through the centres of pixel and lens, and so exact, except "filtered" ones, which are means over the
pixel filter. Lengths are in scene units. An AOV's source is a name of AOVS, "primvar:NAME" or another prefixed name below. The
data type of a UsdRenderVar decides the number, names and storage of its channels in a file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from .errors import SettingsError, did_you_mean

WIDE = "aov:"  # prefix of a primvar read for an AOV: all of its components, where surfaces read fewer of them


@dataclass(frozen=True)
class AovKind:
    channels: tuple[str, ...]  # names after the AOV's name and a dot; a single one: the whole name, or "" for the AOV's own
    meaning: str
    unsigned: bool = False  # 32-bit whole numbers
    double: bool = False  # in memory; files store floats
    filtered: bool = False  # a mean over samples, with standard errors; others are exact


XYZ, RGB, UV, XY = ("X", "Y", "Z"), ("R", "G", "B"), ("U", "V"), ("X", "Y")
NAMING_INSTANCES = frozenset({"instance", "crypto_object", "crypto_asset"})
VECTORS = frozenset({"motion_forward", "motion_backward"})

AOVS: dict[str, AovKind] = {
    "depth": AovKind(("Z",), "distance along the camera's axis; infinite where nothing is"),
    "distance": AovKind(("",), "distance along the ray; infinite where nothing is"),
    "position": AovKind(XYZ, "point in the world; 0 where nothing is", double=True),
    "camera_position": AovKind(XYZ, "point relative to the camera, in its axes (in front: Z below 0)"),
    "normal": AovKind(XYZ, "unit shading normal in the world, normal maps included, on the visible side"),
    "geometric_normal": AovKind(XYZ, "unit normal of the true surface in the world, on the visible side"),
    "camera_normal": AovKind(XYZ, "unit shading normal in the camera's axes"),
    "st": AovKind(UV, "the primvar st"),
    "albedo": AovKind(
        RGB, "filtered reflectance at normal incidence, transmission included; 0 where nothing is", filtered=True
    ),
    "emission": AovKind(RGB, "filtered radiance of what the camera sees directly: surfaces, lights, domes", filtered=True),
    "volume_opacity": AovKind(
        RGB, "filtered share of light that volumes extinguish before the first surface; 0 where there are none", filtered=True
    ),
    "volume_depth": AovKind(
        ("",), "mean distance along the camera's axis of what volumes extinguish there; infinite where there are none"
    ),
    "guide_albedo": AovKind(
        RGB, "like albedo, over the shutter interval, in mirrors and through clear glass: a denoiser's guide", filtered=True
    ),
    "guide_normal": AovKind(
        XYZ, "mean of unit normals over filter, lens and shutter, in mirrors and through clear glass", filtered=True
    ),
    "occlusion": AovKind(
        ("",),
        "filtered share of the directions above the surface, cosine-weighted, that hit nothing within a distance; 1: open",
        filtered=True,
    ),
    "motion_forward": AovKind(
        XY, "pixels, right and down, from where the point is seen at the frame to where it is as the shutter closes"
    ),
    "motion_backward": AovKind(
        XY, "pixels, right and down, from where the point is seen at the frame to where it is as the shutter opens"
    ),
    "prim": AovKind(("",), "number of the prim; 0 where nothing is", unsigned=True),
    "instance": AovKind(("",), "number of the instance; 0 where there is none", unsigned=True),
    "material": AovKind(("",), "number of the bound material; 0 where there is none", unsigned=True),
    "samples": AovKind(("",), "samples that the pixel took", unsigned=True),
}


OCCLUSION = "occlusion"  # or with a distance in scene units, occlusion:0.5; the default is a metre


def kind_of(source: str) -> AovKind | None:
    """Return the row of AOVS of a source; None if it has none."""
    return AOVS.get(OCCLUSION if source.startswith(f"{OCCLUSION}:") else source)


def occlusion_distance(source: str) -> float | None:
    """Return the distance in a source name occlusion:DISTANCE, in scene units; None without a valid one."""
    name, _, text = source.partition(":")
    try:
        distance = float(text) if name == OCCLUSION else math.nan
    except ValueError:
        return None
    return distance if 0 < distance < math.inf else None


@dataclass(frozen=True)
class CryptomatteKind:
    layer: str  # its name in a file
    meaning: str


CRYPTOMATTES: dict[str, CryptomatteKind] = {
    "crypto_object": CryptomatteKind("CryptoObject", "Cryptomatte by prim, instance by instance"),
    "crypto_material": CryptomatteKind("CryptoMaterial", "Cryptomatte by bound material"),
    "crypto_asset": CryptomatteKind("CryptoAsset", "Cryptomatte by asset: the instance, or the nearest model above a prim"),
}
# Samples of each pixel by depth: a file of its own, not a part of the picture's.
DEEP = "deep"
DEEP_BYTES = 500  # bytes per pixel, for about four samples
# Always present, in the picture itself.
IN_PICTURE = ("beauty", "alpha", "stderr")
PRIMVAR = "primvar:"
LIGHT_PATH = "lpe:"  # before a light path expression
# Light paths that other renderers have names for; domes are lights, and fire is an object that glows.
NAMED_LIGHT_PATHS = {"volume": "CV.*", "volume_direct": "CVL", "volume_indirect": "CV[^L].*"}
LIGHTS = "lights"  # an output for each light or light group; light_mix/parts.py makes expressions of it
LIGHT_PATH_BYTES = 320  # bytes per pixel of an expression: exact sums and the values made of them
# Before a taxonomy of semantic labels: sets of labels that are inherited, classes of things, things.
LABELS, SEMANTIC, THINGS = "labels:", "semantic:", "object_instance:"
USUAL_TAXONOMY = "class"  # of "semantic" and "object_instance" alone
CRYPTOMATTE_BYTES = 128  # bytes per pixel, for about four surfaces
MOST_COMPONENTS = 4
LONGEST_NAME = 256
_EXPRESSION = re.compile(r"C([.*+?<\[({|RTVDGSsLOB]|$)")
_PRIMVAR_NAME = re.compile(r"[^\s,\x00-\x1f]+")


@dataclass(frozen=True)
class AovRequest:
    """A requested AOV: `name` of its part and channels in a file, a UsdRenderVar's `data_type` ("": the source's own).

    `errors`: standard errors are requested, too, if the source has any; `differences`: and the signed differences of both
    replicates, for light path expressions. `header`: further attributes of its part in a file.
    """

    name: str
    source: str
    data_type: str = ""
    errors: bool = False
    prefix: str | None = None  # of its channels in a file, instead of the name
    differences: bool = False
    header: tuple[tuple[str, str], ...] = ()


def check_names(names: Iterable[str]) -> None:
    """Raise SettingsError for an unknown name."""
    for name in names:
        if not isinstance(name, str) or not (
            name in AOVS
            or name in CRYPTOMATTES
            or name in IN_PICTURE
            or name in (DEEP, LIGHTS)
            or name in NAMED_LIGHT_PATHS
            or name + ":" in (SEMANTIC, THINGS)
            or _is_named(name)
            or is_light_path(name)
            or occlusion_distance(name) is not None
        ):
            every = (*AOVS, *NAMED_LIGHT_PATHS, LIGHTS, *CRYPTOMATTES, DEEP, *IN_PICTURE)
            known, near = ", ".join(every), did_you_mean(str(name), every)
            sentence = f"there is no AOV {name!r}{f'; {near} There' if near else '; there'} are {known}, "
            sentence += "occlusion:DISTANCE, primvar:NAME, labels:TAXONOMY, semantic:TAXONOMY, "
            sentence += "object_instance:TAXONOMY and light path expressions"
            raise SettingsError(sentence, where="aovs", code="unknown-aov")


def is_light_path(name: str) -> bool:
    """Return whether a name is meant as a light path expression (valid or not): it has the prefix, or begins with C."""
    return name.startswith(LIGHT_PATH) or (_EXPRESSION.match(name) is not None and name not in ("C", "Ci", "Cs"))


def needs_light(name: str) -> bool:
    """Return whether an AOV, by its name or its source, is made of the samples of a render."""
    of_samples = (*CRYPTOMATTES, *IN_PICTURE, *NAMED_LIGHT_PATHS, DEEP, LIGHTS, "samples")
    return name in of_samples or is_light_path(name)


def without_prefix(text: str) -> str:
    """Return an expression without blanks, and without the prefixes that other renderers' files use."""
    kept, quoted = [], False
    for letter in text:
        quoted = quoted != (letter == "'")
        if quoted or not letter.isspace():
            kept.append(letter)
    plain = "".join(kept)
    for prefix in ("color", "lpe:"):
        if plain.lower().startswith(prefix):
            plain = plain[len(prefix) :]
    return plain


def light_path_of(source: str) -> str | None:
    """Return the light path expression of a source, None if it is none."""
    return source.removeprefix(LIGHT_PATH) if source.startswith(LIGHT_PATH) else None


def light_paths_of(requests: Iterable[AovRequest]) -> tuple[str, ...]:
    """Return the requested light path expressions, each once."""
    return tuple(dict.fromkeys(e for e in (light_path_of(r.source) for r in requests) if e is not None))


def _is_named(name: str) -> bool:
    """Return whether a name is valid for a primvar or for labels of a taxonomy."""
    kind = next((prefix for prefix in (PRIMVAR, LABELS, SEMANTIC, THINGS) if name.startswith(prefix)), None)
    own = name.removeprefix(kind or "")
    return kind is not None and len(own) <= LONGEST_NAME and _PRIMVAR_NAME.fullmatch(own) is not None


def with_distances(requests: Iterable[AovRequest], meters_per_unit: float) -> tuple[AovRequest, ...]:
    """Return the requests with a distance of one metre, in scene units, for occlusion without one."""
    metre = f"{OCCLUSION}:{1 / meters_per_unit:.9g}"
    return tuple(replace(request, source=metre) if request.source == OCCLUSION else request for request in requests)


def taxonomy_of(source: str) -> str | None:
    """Return the taxonomy whose labels a source holds, None if it holds none."""
    prefix = next((prefix for prefix in (LABELS, SEMANTIC, THINGS) if source.startswith(prefix)), None)
    return None if prefix is None else source.removeprefix(prefix)


def shows_things(source: str) -> bool:
    """Return whether a source depends on which prims have labels of their own."""
    return source.startswith((SEMANTIC, THINGS))


def names_instances(source: str) -> bool:
    """Return whether a source depends on names of instances."""
    return source in NAMING_INSTANCES or taxonomy_of(source) is not None


def requests_of(names: Iterable[str]) -> tuple[AovRequest, ...]:
    """Return requests for the names, each once, without those that every picture has."""
    return tuple(_request(name) for name in dict.fromkeys(names) if name not in IN_PICTURE)


def _request(name: str) -> AovRequest:
    if occlusion_distance(name) is not None:  # a dot in a channel's name would begin another layer
        return AovRequest(name, name, prefix=OCCLUSION)
    if name + ":" in (SEMANTIC, THINGS):
        return AovRequest(name, f"{name}:{USUAL_TAXONOMY}")
    if name in NAMED_LIGHT_PATHS:
        return AovRequest(name, LIGHT_PATH + NAMED_LIGHT_PATHS[name])
    if not is_light_path(name):
        return AovRequest(name, name)
    expression = without_prefix(name)
    return AovRequest(expression, LIGHT_PATH + expression)


def has_deep(requests: Iterable[AovRequest]) -> bool:
    """Return whether a deep picture is requested."""
    return any(request.source == DEEP for request in requests)


def primvar_of(source: str) -> str | None:
    """Return the primvar that a source reads, None if it reads none."""
    if source == "st":
        return "st"
    return source.removeprefix(PRIMVAR) if source.startswith(PRIMVAR) else None


def primvars_of(requests: Iterable[AovRequest]) -> tuple[str, ...]:
    """Return the primvars that requests read, each once."""
    return tuple(dict.fromkeys(name for name in (primvar_of(r.source) for r in requests) if name is not None))


def aov_bytes(requests: Iterable[AovRequest]) -> int:
    """Return an upper estimate of the bytes per pixel: each AOV is in memory twice while a file is written."""
    total = 0
    for request in requests:
        kind = kind_of(request.source)
        if request.source == DEEP:
            total += DEEP_BYTES
            continue
        if request.source in CRYPTOMATTES or light_path_of(request.source) is not None:
            total += CRYPTOMATTE_BYTES if request.source in CRYPTOMATTES else LIGHT_PATH_BYTES
            continue
        numbers = MOST_COMPONENTS if kind is None else len(kind.channels)
        total += numbers * (16 if kind is not None and kind.double else 8) * (2 if request.errors else 1)
    return total


Stored = Literal["float", "half", "uint"]

# "A USD attribute type", of which the number of components, the role and the precision count.
_TYPE = re.compile(
    r"(float|half|double|int|uint|uchar|int64|uint64|bool)([234]?)|(color|point|vector|normal|texCoord)([234])([fhd])"
)
_LETTERS = {1: ("",), 2: UV, 3: XYZ, 4: ("R", "G", "B", "A")}


@dataclass(frozen=True)
class DataType:
    """Channels of an AOV in a file."""

    components: int
    letters: tuple[str, ...]
    stored: Stored


def data_type_of(text: str) -> DataType | None:
    """Return the channels for a UsdRenderVar's dataType; None for types that channels cannot hold."""
    match = _TYPE.fullmatch(text)
    if match is None:
        return None
    number, size, role, role_size, precision = match.groups()
    count = int(size or role_size or 1)
    letters = (("R", "G", "B", "A")[:count] if role == "color" else _LETTERS[count]) if count > 1 else ("",)
    if number in ("int", "uint", "uchar", "int64", "uint64", "bool"):
        return DataType(count, letters, "uint")
    return DataType(count, letters, "half" if number == "half" or precision == "h" else "float")
