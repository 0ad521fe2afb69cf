"""All textures of a description, each file read once, several in parallel; files that cannot be read are reported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from ..description import LightType, SceneDescription, TextureFile, TextureInput, Wrap
from ..description.pattern_reads import pattern_files
from ..diagnostics import Diagnostics
from ..errors import AssetError, LimitError
from .texture import ReadAsset, Texture, load_texture

TextureSet = dict[TextureFile, list[tuple[int, Texture]]]

THREADS = 8
LIGHT_LEFT_OUT = "the light is left out"
BRIGHTEST_TEXEL = 1e15  # for lights: times the light's colour it must remain a finite float


@dataclass
class _Use:
    """Readers of a file: the channels that they read, and where to report problems."""

    channels: set[str] = field(default_factory=set)
    light: str | None = None  # path of the light that reads it
    without: str = ""  # consequence for that light where the file cannot be read
    surface: str = ""


def load_texture_set(
    description: SceneDescription, diagnostics: Diagnostics, read: ReadAsset | None, unsaid: Wrap = Wrap.BLACK
) -> TextureSet:
    """Return the images of all readable files with their tile numbers, or 0; files that name no wrap get `unsaid`."""
    uses = _uses(description)
    same = _alpha_elsewhere(uses)
    for other in same.values():
        uses[other].channels.add("a")
    jobs = [(file, number, path) for file in uses if file not in same for number, path in _images(file)]

    def load(job: tuple[TextureFile, int, str]) -> Texture | AssetError | LimitError:
        file, _, path = job
        return _loaded(file, path, uses[file], read, unsaid)

    found: TextureSet = {}
    with ThreadPoolExecutor(min(THREADS, len(os.sched_getaffinity(0)))) as threads:
        for (file, number, path), loaded in zip(jobs, threads.map(load, jobs), strict=True):
            if isinstance(loaded, Texture):
                found.setdefault(file, []).append((number, _noted(loaded, path, uses[file], diagnostics)))
            else:
                _note_unreadable(loaded, uses[file], diagnostics)
    return found | {file: found[other] for file, other in same.items() if other in found}


def note_unreadable(
    description: SceneDescription, unreadable: set[str], diagnostics: Diagnostics, read: ReadAsset | None
) -> None:
    """Report these paths, whose headers could not be read, as loading them would."""
    uses = _uses(description)
    for file in uses:
        for _, path in _images(file):
            if path in unreadable and not isinstance(error := _loaded(file, path, uses[file], read), Texture):
                _note_unreadable(error, uses[file], diagnostics)


def _loaded(
    file: TextureFile, path: str, use: _Use, read: ReadAsset | None, unsaid: Wrap = Wrap.BLACK
) -> Texture | AssetError | LimitError:
    try:
        return load_texture(file, read, path=path, channels=frozenset(use.channels), unsaid=unsaid)
    except (AssetError, LimitError) as error:
        return error


def _uses(description: SceneDescription) -> dict[TextureFile, _Use]:
    uses: dict[TextureFile, _Use] = {}
    for light in description.lights:
        if light.texture is not None:
            use = uses.setdefault(light.texture, _Use())
            use.channels |= set("rgb")
            use.light = use.light or light.path
            use.without = "it shines without its texture" if light.type is LightType.RECT else LIGHT_LEFT_OUT
    for surface in description.surfaces:
        for _, reads in surface.inputs:
            if isinstance(reads, TextureInput) and reads.file.path:
                use = uses.setdefault(reads.file, _Use())
                use.channels |= set(reads.channels)
                use.surface = use.surface or surface.path
        for file, channels in pattern_files(surface.pattern).items() if surface.pattern else ():
            use = uses.setdefault(file, _Use())
            use.channels |= channels
            use.surface = use.surface or surface.path
    return uses


def _alpha_elsewhere(uses: dict[TextureFile, _Use]) -> dict[TextureFile, TextureFile]:
    """Return, for files of which only alpha is read, the same file in another colour space, which has the same alpha."""
    read_more = {_texels_of(f): f for f, use in uses.items() if use.channels != {"a"} and use.light is None}
    only_alpha = [f for f, use in uses.items() if use.channels == {"a"}]
    return {f: read_more[_texels_of(f)] for f in only_alpha if _texels_of(f) in read_more}


def _texels_of(file: TextureFile) -> tuple[object, ...]:
    """Return a key for a file's texels before colour conversion."""
    return file.path, file.tiles, file.layer


def _images(file: TextureFile) -> Iterator[tuple[int, str]]:
    yield from file.tiles or ((0, file.path),)


def _noted(texture: Texture, path: str, use: _Use, diagnostics: Diagnostics) -> Texture:
    bad, where = texture.bad_texels, use.light or use.surface
    if use.light is not None and texture.to_target is not None and (texture.to_target < 0).any():
        texture = replace(texture, stored=texture.pixels, srgb_channels=0, to_target=None)
    if use.light is not None and texture.stored.dtype.kind == "f":  # radiance must not be negative
        negative = _texels(texture.stored < 0)
        if negative:  # possibly out of gamut: clamping keeps the other channels
            bad += negative
            texture = replace(texture, stored=np.maximum(texture.stored, np.float32(0)))
        bright = _texels(texture.stored > BRIGHTEST_TEXEL)
        if bright:
            diagnostics.add(
                "texture-bad-texels", where, f"{bright} texels are above {BRIGHTEST_TEXEL:g} and are clamped to it ({path})"
            )
            texture = replace(texture, stored=np.minimum(texture.stored, np.float32(BRIGHTEST_TEXEL)))
    if bad:
        kind = "negative (or outside the rendering space) or not finite" if use.light is not None else "not finite"
        diagnostics.add("texture-bad-texels", where, f"{bad} texels are {kind} and are read as 0 ({path})")
    if texture.turned:
        diagnostics.add("texture-turned", where, f"The file's orientation (rotated or mirrored) is ignored ({path}).")
    return texture


def _texels(marked: npt.NDArray[np.bool_]) -> int:
    """Return the number of texels with a marked channel, (H, W, C); checking for none first is thirty times as fast."""
    return int(np.count_nonzero(marked.any(axis=2))) if marked.any() else 0


def _note_unreadable(error: AssetError | LimitError, use: _Use, diagnostics: Diagnostics) -> None:
    if use.light is not None:
        diagnostics.add("texture-unreadable", use.light, f"{use.without}: {error.message} ({error.where})")
    if use.surface:
        diagnostics.add("texture-unreadable", use.surface, f"the fallback is used: {error.message} ({error.where})")
