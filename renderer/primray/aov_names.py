"""The outputs beside the picture that can be asked for (AOVs), by name; what each holds is written here and nowhere else.

Point samples are taken through the pixel's centre and the lens' centre, and so are exact; "filtered" ones are means over the
pixel filter. Lengths are in scene units. What an AOV is made of is its source: a name of AOVS, or "primvar:NAME".
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from .errors import SettingsError, did_you_mean

WIDE = "aov:"  # before a primvar's name: all of its numbers, where surfaces read fewer of them


@dataclass(frozen=True)
class AovKind:
    channels: tuple[str, ...]  # behind the AOV's name and a dot; one alone: the channel's whole name, or "" for the AOV's own
    meaning: str
    unsigned: bool = False  # 32-bit whole numbers
    double: bool = False  # in memory; a file has floats
    filtered: bool = False  # a mean over samples, with an error; others are exact


XYZ, RGB, UV, XY = ("X", "Y", "Z"), ("R", "G", "B"), ("U", "V"), ("X", "Y")
NAMING_INSTANCES = frozenset({"instance", "crypto_object", "crypto_asset"})
VECTORS = frozenset({"motion_forward", "motion_backward"})

AOVS: dict[str, AovKind] = {
    "depth": AovKind(("Z",), "distance along the camera's axis; infinite where nothing is"),
    "distance": AovKind(("",), "distance along the ray; infinite where nothing is"),
    "position": AovKind(XYZ, "point in the world; 0 where nothing is", double=True),
    "camera_position": AovKind(XYZ, "point relative to the camera, in its axes (in front: Z below 0)"),
    "normal": AovKind(XYZ, "unit shading normal in the world, normal maps included, on the side that is seen"),
    "geometric_normal": AovKind(XYZ, "unit normal of the true surface in the world, on the side that is seen"),
    "camera_normal": AovKind(XYZ, "unit shading normal in the camera's axes"),
    "st": AovKind(UV, "the primvar st"),
    "albedo": AovKind(
        RGB, "filtered reflectance at normal incidence, with what is transmitted; 0 where nothing is", filtered=True
    ),
    "emission": AovKind(RGB, "filtered radiance of what the camera sees directly: surfaces, lights, domes", filtered=True),
    "guide_albedo": AovKind(
        RGB, "as albedo, over the shutter's time, in mirrors and through clear glass: what guides a denoiser", filtered=True
    ),
    "guide_normal": AovKind(XYZ, "mean of unit normals over filter, lens and shutter, likewise", filtered=True),
    "occlusion": AovKind(
        ("",),
        "filtered share of the directions above the surface, by their cosine, that meet nothing within a distance; 1: open",
        filtered=True,
    ),
    "motion_forward": AovKind(
        XY, "pixels, right and down, from where the point is seen at the frame to where it is as the shutter closes"
    ),
    "motion_backward": AovKind(XY, "likewise to where it is as the shutter opens"),
    "prim": AovKind(("",), "number of the prim; 0 where nothing is", unsigned=True),
    "instance": AovKind(("",), "number of the instance; 0 where there is none", unsigned=True),
    "material": AovKind(("",), "number of the bound material; 0 where there is none", unsigned=True),
    "samples": AovKind(("",), "samples that the pixel took", unsigned=True),
}


OCCLUSION = "occlusion"  # and with its distance in scene units, occlusion:0.5; without one it is a metre


def kind_of(source: str) -> AovKind | None:
    """The row of AOVS that a source is of."""
    return AOVS.get(OCCLUSION if source.startswith(f"{OCCLUSION}:") else source)


def occlusion_distance(source: str) -> float | None:
    """The distance that a source's name gives occlusion, in scene units; None where it gives none, or none that can be."""
    name, _, text = source.partition(":")
    try:
        distance = float(text) if name == OCCLUSION else math.nan
    except ValueError:
        return None
    return distance if 0 < distance < math.inf else None


@dataclass(frozen=True)
class CryptomatteKind:
    layer: str  # in a file
    meaning: str


CRYPTOMATTES: dict[str, CryptomatteKind] = {
    "crypto_object": CryptomatteKind("CryptoObject", "Cryptomatte by prim, instance by instance"),
    "crypto_material": CryptomatteKind("CryptoMaterial", "Cryptomatte by bound material"),
    "crypto_asset": CryptomatteKind("CryptoAsset", "Cryptomatte by asset: the instance, or the nearest model above a prim"),
}
# Always there, in the picture itself.
IN_PICTURE = ("beauty", "alpha", "stderr")
PRIMVAR = "primvar:"
LIGHT_PATH = "lpe:"  # before a light path expression
ROUTE_BYTES = 320  # a pixel of an expression: of exact sums, and of what is made of them
LABELS = "labels:"  # before a taxonomy of semantic labels
CRYPTOMATTE_BYTES = 128  # a pixel: of some four surfaces
MOST_COMPONENTS = 4
LONGEST_NAME = 256
_EXPRESSION = re.compile(r"C([.*+?<\[({|RTVDGSsLOB]|$)")
_PRIMVAR_NAME = re.compile(r"[^\s,\x00-\x1f]+")


@dataclass(frozen=True)
class AovRequest:
    """`name` is its part's and its channels' in a file, `data_type` a UsdRenderVar's ("": as the source has it), `errors`
    whether standard errors are asked for beside values that have any."""

    name: str
    source: str
    data_type: str = ""
    errors: bool = False
    prefix: str | None = None  # of its channels in a file, in place of the name


def check_names(names: Iterable[str]) -> None:
    """SettingsError for a name that means nothing."""
    for name in names:
        if not isinstance(name, str) or not (
            name in AOVS
            or name in CRYPTOMATTES
            or name in IN_PICTURE
            or _is_named(name)
            or is_light_path(name)
            or occlusion_distance(name) is not None
        ):
            known = ", ".join((*AOVS, *CRYPTOMATTES, *IN_PICTURE))
            near = did_you_mean(str(name), (*AOVS, *CRYPTOMATTES, *IN_PICTURE))
            sentence = f"there is no AOV {name!r}{f'; {near} There' if near else '; there'} are {known}, "
            sentence += "occlusion:DISTANCE, primvar:NAME, labels:TAXONOMY and light path expressions"
            raise SettingsError(sentence, where="aovs", code="unknown-aov")


def is_light_path(name: str) -> bool:
    """Whether it is meant for an expression, which need not be a right one: it says so, or begins at the camera."""
    return name.startswith(LIGHT_PATH) or (_EXPRESSION.match(name) is not None and name not in ("C", "Ci", "Cs"))


def without_prefix(text: str) -> str:
    """Without blanks, and what other renderers' files put before it."""
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
    """The expression that a source is."""
    return source.removeprefix(LIGHT_PATH) if source.startswith(LIGHT_PATH) else None


def light_paths_of(requests: Iterable[AovRequest]) -> tuple[str, ...]:
    """The expressions that are asked for, each once."""
    return tuple(dict.fromkeys(e for e in (light_path_of(r.source) for r in requests) if e is not None))


def _is_named(name: str) -> bool:
    """A primvar, or labels of a taxonomy."""
    kind = next((prefix for prefix in (PRIMVAR, LABELS) if name.startswith(prefix)), None)
    own = name.removeprefix(kind or "")
    return kind is not None and len(own) <= LONGEST_NAME and _PRIMVAR_NAME.fullmatch(own) is not None


def with_distances(requests: Iterable[AovRequest], meters_per_unit: float) -> tuple[AovRequest, ...]:
    """The requests with the distance of occlusion in scene units where none is said: a metre."""
    metre = f"{OCCLUSION}:{1 / meters_per_unit:.9g}"
    return tuple(replace(request, source=metre) if request.source == OCCLUSION else request for request in requests)


def taxonomy_of(source: str) -> str | None:
    """The taxonomy whose labels a source is."""
    return source.removeprefix(LABELS) if source.startswith(LABELS) else None


def names_instances(source: str) -> bool:
    """Whether what is asked for is told by the names of instances."""
    return source in NAMING_INSTANCES or source.startswith(LABELS)


def requests_of(names: Iterable[str]) -> tuple[AovRequest, ...]:
    """Each once; those that every picture has need no request."""
    return tuple(_request(name) for name in dict.fromkeys(names) if name not in IN_PICTURE)


def _request(name: str) -> AovRequest:
    if occlusion_distance(name) is not None:  # a point in a channel's name would begin another layer
        return AovRequest(name, name, prefix=OCCLUSION)
    if not is_light_path(name):
        return AovRequest(name, name)
    expression = without_prefix(name)
    return AovRequest(expression, LIGHT_PATH + expression)


def primvar_of(source: str) -> str | None:
    """The primvar that a source is."""
    if source == "st":
        return "st"
    return source.removeprefix(PRIMVAR) if source.startswith(PRIMVAR) else None


def primvars_of(requests: Iterable[AovRequest]) -> tuple[str, ...]:
    """The primvars that requests read, each once."""
    return tuple(dict.fromkeys(name for name in (primvar_of(r.source) for r in requests) if name is not None))


def aov_bytes(requests: Iterable[AovRequest]) -> int:
    """Of memory a pixel, a little more than they take: each stands twice while a file is written."""
    total = 0
    for request in requests:
        kind = kind_of(request.source)
        if request.source in CRYPTOMATTES or light_path_of(request.source) is not None:
            total += CRYPTOMATTE_BYTES if request.source in CRYPTOMATTES else ROUTE_BYTES
            continue
        numbers = MOST_COMPONENTS if kind is None else len(kind.channels)
        total += numbers * (16 if kind is not None and kind.double else 8) * (2 if request.errors else 1)
    return total
