"""Reasons why surfaces have no colour, or are black: no material, an unknown one, a missing file, or authored grey."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from ..diagnostic_codes import CODES
from .examined import Examined, bare_shapes
from .finding import Finding, Question

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


def findings(seen: Examined) -> Iterator[Finding]:
    told = [*_unbound(seen), *_by_material(seen)]
    yield from told
    share = grey_share(seen)
    if not told and share is not None and share > MOSTLY:
        said = f"{share:.0%} of the visible surfaces have an albedo without colour, and all of their materials are as authored."
        yield Finding(Question.GREY, "grey-as-authored", said, "Author colours or textures in the materials.", (), share)


def grey_share(seen: Examined) -> float | None:
    """Return the fraction of the pixels on surfaces whose albedo has equal channels; None where no surface is seen."""
    hit = seen.prims > 0
    if not hit.any():
        return None
    albedo = seen.image.aovs["albedo"].values[hit]
    return float(np.mean(np.ptp(albedo, axis=1) <= COLORLESS * albedo.max(axis=1)))


def _unbound(seen: Examined) -> Iterator[Finding]:
    explained = {path for code in OF_MATERIALS for path in _concerned(seen, code)}
    bare = bare_shapes(seen.description)
    paths = [path for path in bare if seen.bound.get(path, "") not in explained and path not in explained]
    if not paths:
        return
    numbers = _numbers_of(seen, set(paths))
    share = _share(seen, (seen.materials == 0) & np.isin(seen.prims, numbers))
    said = f"{len(paths):,} shape{'s have' if len(paths) > 1 else ' has'} neither a material nor a displayColor: 18 % grey"
    advice = "Bind a material (MaterialBindingAPI) that has a surface, or author primvars:displayColor."
    most = sorted(paths, key=lambda path: -int(np.isin(seen.prims, _numbers_of(seen, {path})).sum()))
    yield Finding(Question.GREY, "no-material", f"{said}{_of_what_is_seen(share)}.", advice, tuple(most), share)


def _by_material(seen: Examined) -> Iterator[Finding]:
    numbers = {path: number for number, path in seen.names("material").items()}
    for code in OF_MATERIALS:
        messages = [d.message for d in seen.diagnostics if d.code == code]
        if not messages:
            continue
        prims = _concerned(seen, code)
        shapes = {path for path, material in seen.bound.items() if material in prims} | set(prims)
        worn = np.isin(seen.materials, [numbers[path] for path in prims if path in numbers])
        where = worn | np.isin(seen.prims, _numbers_of(seen, shapes))
        share = _share(seen, where)
        more = f" (and {len(messages) - 1:,} more)" if len(messages) > 1 else ""
        said = f"{messages[0].rstrip('.')}{more}{_of_what_is_seen(share)}."
        question = Question.DARK if _is_black(seen, where) else Question.GREY
        yield Finding(question, code, said, CODES[code].advice, prims, share)


def _is_black(seen: Examined, where: npt.NDArray[np.bool_]) -> bool:
    """Return whether the surfaces in these pixels reflect almost nothing, as where the image of a texture is missing."""
    albedo = seen.image.aovs["albedo"].values[where]
    return len(albedo) > 0 and float(albedo.mean()) < BLACK


def _concerned(seen: Examined, code: str) -> tuple[str, ...]:
    """Return the prims that diagnostics of a code name, with materials in place of their shaders."""
    known = {surface.path for surface in seen.description.surfaces if surface.path} | set(seen.bound.values())
    paths = dict.fromkeys(d.prim_path for d in seen.diagnostics if d.code == code)
    return tuple(dict.fromkeys(next((p for p in _upwards(path) if p in known), path) for path in paths))


def _upwards(path: str) -> Iterator[str]:
    while path:
        yield path
        path = path.rpartition("/")[0]


def _numbers_of(seen: Examined, paths: set[str]) -> list[int]:
    return [number for number, path in seen.names("prim").items() if path in paths]


def _share(seen: Examined, covered: npt.NDArray[np.bool_]) -> float:
    hit = int((seen.prims > 0).sum())
    return float(covered.sum() / hit) if hit else 0.0


def _of_what_is_seen(share: float) -> str:
    return f"; {share:.0%} of the visible surfaces" if share else "; not seen directly"
