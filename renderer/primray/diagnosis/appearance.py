"""Reasons why a picture is empty, dark or grey: geometry that is hidden, missing or tiny; missing light; missing materials."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from ..description import Surface
from ..diagnostic_codes import CODES, Kind, Severity
from ..diagnostics import Diagnostic
from ..images.exposure import View, view_fault
from ..images.image import MISSING_TEXTURES
from ..report.picture_checks import IMAGES, why_empty
from .examination import Examined, Finding, Question, bare_shapes

SMALL_SHARE = 0.01  # fraction of the pixels
LARGEST_M, SMALLEST_M = 1e5, 1e-3  # sizes of plausible stages in metres: from a jewel to a landscape


def find_empty(seen: Examined) -> Iterator[Finding]:
    yield from _view(seen)
    yield from _missing(seen)
    yield from _hidden(seen)
    yield from _size(seen)


def _view(seen: Examined) -> Iterator[Finding]:
    bounds, share = seen.prepared.scene.bounds, seen.hit_share
    camera = seen.prepared.camera.path or "the automatic camera"
    here = (seen.prepared.camera.path,) if seen.prepared.camera.path else ()
    if bounds is None:
        said = why_empty(seen.prepared, seen.image.pixels, seen.diagnostics)
        yield Finding(
            question=Question.EMPTY,
            code="nothing-drawn",
            message=said,
            advice="Add or show what the message names.",
            prims=here,
            share=1.0,
        )
    elif share == 0 and not seen.image.pixels[..., 3].any():
        said = f"No ray of {camera} hits anything. {why_empty(seen.prepared, seen.image.pixels, seen.diagnostics)}"
        advice = "Use another camera (--camera), or let --auto-camera frame the stage."
        yield Finding(question=Question.EMPTY, code="camera-sees-nothing", message=said, advice=advice, prims=here, share=1.0)
    elif share < SMALL_SHARE and seen.volume_share < SMALL_SHARE:
        depth = seen.image.aovs["depth"].values[..., 0]
        nearest = float(depth.min(initial=np.inf, where=np.isfinite(depth)))
        diameter = float(np.linalg.norm(np.subtract(bounds[1], bounds[0])))
        said = f"Surfaces cover {share:.2%} of the picture: the stage is {diameter:.4g} units across" + (
            f", and {nearest:.4g} away from {camera}" if np.isfinite(nearest) else ""
        )
        advice = "Move the camera closer, correct the scale (metersPerUnit) of referenced assets, or use --auto-camera."
        yield Finding(
            question=Question.EMPTY, code="small-in-view", message=f"{said}.", advice=advice, prims=here, share=1 - share
        )


def _missing(seen: Examined) -> Iterator[Finding]:
    """Yield what the stage lacks, from diagnostics; `grey` reports missing files of materials."""
    of_code: dict[str, list[str]] = {}
    for told in seen.diagnostics:
        severe = told.severity is Severity.ERROR or told.code == "payloads-unloaded"
        if told.kind is Kind.MISSING and severe and told.code not in IMAGES:
            of_code.setdefault(told.code, []).append(told.prim_path)
    for code, prims in of_code.items():
        yield Finding(Question.EMPTY, code, CODES[code].meaning, CODES[code].advice, tuple(dict.fromkeys(prims)))


def _hidden(seen: Examined) -> Iterator[Finding]:
    for why, prims in seen.hidden.items():
        if not why:
            continue
        counted = f"{len(prims):,} shape{'s are' if len(prims) > 1 else ' is'}"
        advice = "Name the purposes to render (--purposes default,proxy,guide)."
        if "purpose" not in why:
            advice = "Make them visible at this frame, or active, if they should be seen."
        yield Finding(Question.EMPTY, "hidden", f"{counted} {why}.", advice, tuple(prims))


def _size(seen: Examined) -> Iterator[Finding]:
    bounds, unit = seen.prepared.scene.bounds, seen.description.meters_per_unit
    if bounds is None:
        return
    metres = float(np.linalg.norm(np.subtract(bounds[1], bounds[0]))) * unit
    if metres > LARGEST_M or 0 < metres < SMALLEST_M:
        said = f"The stage is {metres:.3g} m across (metersPerUnit {unit:g})."
        advice = "Correct metersPerUnit, or remove outlying prims: lenses, media and lights in lumens depend on the scale."
        yield Finding(Question.EMPTY, "size", said, advice)


LIGHTLESS = ("light-dark", "unsupported-light", "link-empty", "instanced-lights", "old-attribute")


def find_dark(seen: Examined) -> Iterator[Finding]:
    told = list(seen.diagnostics)
    pixels = seen.image.pixels
    fog = seen.description.fog
    glows = (
        any(_glows(surface) for surface in seen.description.surfaces)
        or bool(seen.description.volume_emissions)
        or (fog is not None and any(fog.emission))
    )
    if any(diagnostic.code == "default-light" for diagnostic in told):
        said = next(diagnostic.message for diagnostic in told if diagnostic.code == "default-light")
        yield Finding(Question.DARK, "default-light", said, CODES["default-light"].advice)
    elif not seen.prepared.lights and not glows:
        advice = "Add a light (a DomeLight is the simplest), or omit --studio-light off."
        yield Finding(Question.DARK, "no-light", "There is no light, and nothing is emissive.", advice)
    elif (seen.hit_share > 0 or seen.volume_share > 0) and not pixels[..., :3].any():
        said = "What the camera sees is black, though there are lights: none reaches it, or its materials reflect nothing."
        yield Finding(
            Question.DARK,
            "unlit",
            said,
            "Check where lights are and face, their links and intensities; `--studio-light on` adds a light.",
        )
    for code in LIGHTLESS:
        prims = tuple(dict.fromkeys(d.prim_path for d in told if d.code == code))
        if prims:
            yield Finding(Question.DARK, code, CODES[code].meaning, CODES[code].advice, prims)
    missing = any(diagnostic.code in MISSING_TEXTURES for diagnostic in told)
    fault = view_fault(pixels, View(space=seen.image.color_space), lacks_textures=missing)
    if fault is not None:
        yield Finding(Question.DARK, fault.code, fault.message, CODES[fault.code].advice)


def _glows(surface: Surface) -> bool:
    within = surface.volume is not None and any(surface.volume.emission)
    return within or any(value > 0 for value in surface.emissive_color) or "emissive_color" in surface.varying


# Codes of diagnostics that change a material's look, in the order in which they are reported.
OF_MATERIALS = (
    "shader-ignored",
    "asset-missing",
    "texture-unreadable",
    "tile-missing",
    "texture-unset",
    "texture-outside",
    "primvar-missing",
    "binding-missing",
    "shader-connection",
    "pattern-not-computed",
    "connection-type",
    "mdl-material",
    "translated",
    "material-input",
)
MOSTLY = 0.9  # fraction of the visible surfaces
BLACK = 0.06  # albedo: a black dielectric still reflects specularly
COLORLESS = 0.02  # difference of channels, relative to the largest


def find_grey(seen: Examined) -> Iterator[Finding]:
    told = [*_unbound(seen), *_by_material(seen)]
    yield from told
    share = grey_share(seen)
    if not told and share is not None and share > MOSTLY:
        said = f"{share:.0%} of the visible surfaces have an albedo without colour, and all of their materials are as authored."
        yield Finding(
            question=Question.GREY,
            code="grey-as-authored",
            message=said,
            advice="Author colours or textures in the materials.",
            prims=(),
            share=share,
        )


def grey_share(seen: Examined) -> float | None:
    """Return the fraction of the pixels on surfaces whose albedo has equal channels; None where no surface is seen."""
    hit = seen.prims > 0
    if not hit.any():
        return None
    albedo = seen.image.aovs["albedo"].values[hit]
    return float(np.mean(np.ptp(albedo, axis=1) <= COLORLESS * albedo.max(axis=1)))


def _unbound(seen: Examined) -> Iterator[Finding]:
    explained = set(_concerned(seen, (d for d in seen.diagnostics if d.code in OF_MATERIALS)))
    bare = bare_shapes(seen.description)
    paths = [path for path in bare if seen.bound.get(path, "") not in explained and path not in explained]
    if not paths:
        return
    numbers = _numbers_of(seen, set(paths))
    share = _share_of_hits(seen, (seen.materials == 0) & np.isin(seen.prims, numbers))
    said = f"{len(paths):,} shape{'s have' if len(paths) > 1 else ' has'} neither a material nor a displayColor: 18 % grey"
    advice = "Bind a material (MaterialBindingAPI) that has a surface, or author primvars:displayColor."
    most = sorted(paths, key=lambda path: -int(np.isin(seen.prims, _numbers_of(seen, {path})).sum()))
    yield Finding(
        question=Question.GREY,
        code="no-material",
        message=f"{said}{_share_text(share)}.",
        advice=advice,
        prims=tuple(most),
        share=share,
    )


def _by_material(seen: Examined) -> Iterator[Finding]:
    numbers = {path: number for number, path in seen.names("material").items()}
    of_smoke = {medium.material for medium in seen.description.media} - set(seen.bound.values())
    for code in OF_MATERIALS:
        found = [d for d in seen.diagnostics if d.code == code and of_smoke.isdisjoint(_upwards(d.prim_path))]
        messages = [d.message for d in found]
        if not messages:
            continue
        prims = _concerned(seen, found)
        shapes = {path for path, material in seen.bound.items() if material in prims} | set(prims)
        worn = np.isin(seen.materials, [numbers[path] for path in prims if path in numbers])
        where = worn | np.isin(seen.prims, _numbers_of(seen, shapes))
        share = _share_of_hits(seen, where)
        more = f" (and {len(messages) - 1:,} more)" if len(messages) > 1 else ""
        said = f"{messages[0].rstrip('.')}{more}{_share_text(share)}."
        question = Question.DARK if _is_black(seen, where) else Question.GREY
        yield Finding(question=question, code=code, message=said, advice=CODES[code].advice, prims=prims, share=share)


def _is_black(seen: Examined, where: npt.NDArray[np.bool_]) -> bool:
    """Return whether the surfaces in these pixels reflect almost nothing, as where the image of a texture is missing."""
    albedo = seen.image.aovs["albedo"].values[where]
    return len(albedo) > 0 and float(albedo.mean()) < BLACK


def _concerned(seen: Examined, found: Iterable[Diagnostic]) -> tuple[str, ...]:
    """Return the prims that diagnostics name, with materials in place of their shaders."""
    known = {surface.path for surface in seen.description.surfaces if surface.path} | set(seen.bound.values())
    paths = dict.fromkeys(d.prim_path for d in found)
    return tuple(dict.fromkeys(next((p for p in _upwards(path) if p in known), path) for path in paths))


def _upwards(path: str) -> Iterator[str]:
    while path:
        yield path
        path = path.rpartition("/")[0]


def _numbers_of(seen: Examined, paths: set[str]) -> list[int]:
    return [number for number, path in seen.names("prim").items() if path in paths]


def _share_of_hits(seen: Examined, covered: npt.NDArray[np.bool_]) -> float:
    hit = int((seen.prims > 0).sum())
    return float(covered.sum() / hit) if hit else 0.0


def _share_text(share: float) -> str:
    return f"; {share:.0%} of the visible surfaces" if share else "; not seen directly"
