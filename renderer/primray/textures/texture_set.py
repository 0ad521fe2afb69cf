"""All textures of a description, each file read once, several in parallel, and the lights that use them.

Files that cannot be read are reported. Lights are adjusted once their images are known: some are left out, domes get the
layout of their image, and photometric lights their brightness.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description import LightType, SceneDescription, TextureFile, TextureInput, Wrap
from ..description.lighting import Light, Photometric
from ..description.shading import pattern_files
from ..diagnostics import Diagnostic, Diagnostics
from ..errors import AssetError, LimitError
from ..photometry.flux import BRIGHTEST_EMISSION, DARK_TEXT, TOO_BRIGHT_TEXT, amount_of_unit_emission, clamped, scaled_to
from ..photometry.light_shape import shape_key
from ..read_files import note_read
from ..time_spans import span
from .texture import ReadAsset, Texture, load_texture
from .tile_cache import TileCache

TextureSet = dict[TextureFile, list[tuple[int, Texture]]]

THREADS = 8
LIGHT_LEFT_OUT = "the light is left out"
BRIGHTEST_TEXEL = 1e15  # for lights: times the light's colour it must remain a finite float


@dataclass
class Use:
    """Readers of a file: the channels that they read, and where to report problems."""

    channels: set[str] = field(default_factory=set)
    light: str | None = None  # path of the light that reads it
    without: str = ""  # consequence for that light where the file cannot be read
    surface: str = ""


@dataclass(frozen=True)
class LoadedFile:
    """What loading a file gave, which depends on the file and on its readers alone."""

    use: Use
    images: list[tuple[int, Texture]]  # with their tile numbers, or 0; empty if none could be read
    told: tuple[Diagnostic, ...] = ()

    def without_texels(self, made: dict[int, Texture]) -> LoadedFile:
        """Return the same with textures' sizes alone. `made`: those so far by the identity of what they are of, since files
        share images."""
        images = [(number, made.setdefault(id(image), image.without_texels())) for number, image in self.images]
        return replace(self, images=images)


def note_files(description: SceneDescription) -> None:
    """Note the description's images as files of a command, which has no need to read them."""
    for file in _uses(description):
        for _, path in _images(file):
            note_read(path)


def images_of(files: Mapping[TextureFile, LoadedFile]) -> TextureSet:
    """Return the images of the files that could be read."""
    return {file: one.images for file, one in files.items() if one.images}


def load_files(
    description: SceneDescription,
    read: ReadAsset | None,
    default_wrap: Wrap = Wrap.BLACK,
    shown: Callable[[str], str] | None = None,
    known: Mapping[TextureFile, LoadedFile] = MappingProxyType({}),
    only: Collection[TextureFile] | None = None,
    on_image: Callable[[int, int], None] | None = None,
    cache: TileCache | None = None,
) -> dict[TextureFile, LoadedFile]:
    """Return the description's files, or `only` some of them, in the order in which it reads them.

    Files that name no wrap mode get `default_wrap`. Files in `known` that have the same readers are not read again. `shown`
    rewrites messages. `on_image` is called with the number of images that have been read, and of all. `cache`: images of
    surfaces come without texels where their levels are there.
    """
    uses = _uses(description)
    same = _alpha_elsewhere(uses)
    for other in same.values():
        uses[other].channels.add("a")
    found = {file: known[file] for file, use in uses.items() if file in known and known[file].use == use}
    wanted = {same.get(file, file) for file in uses if (file not in found) and (only is None or file in only)}
    jobs = [(file, number, path) for file in uses if file in wanted for number, path in _images(file)]

    def load(job: tuple[TextureFile, int, str]) -> Texture | AssetError | LimitError:
        file, _, path = job
        return _load(file, path, uses[file], read, default_wrap, cache)

    images: TextureSet = {file: [] for file in wanted}
    told = {file: Diagnostics(shown) for file in wanted}
    if jobs:
        with ThreadPoolExecutor(min(THREADS, len(os.sched_getaffinity(0)))) as threads:
            for done, ((file, number, path), loaded) in enumerate(zip(jobs, threads.map(load, jobs), strict=True)):
                if on_image is not None:
                    on_image(done, len(jobs))
                if isinstance(loaded, Texture):
                    images[file].append((number, _usable(loaded, path, uses[file], told[file])))
                else:
                    _note_unreadable(loaded, uses[file], told[file])
    made: dict[TextureFile, LoadedFile] = {}
    for file, use in uses.items():
        if file in wanted:
            made[file] = LoadedFile(use, images[file], tuple(told[file]))
        elif same.get(file) in wanted and file not in found:
            made[file] = LoadedFile(use, images[same[file]])
        elif file in found:
            made[file] = found[file]
    return made if only is None else {file: one for file, one in made.items() if file in only}


def note_unreadable(
    description: SceneDescription, unreadable: set[str], diagnostics: Diagnostics, read: ReadAsset | None
) -> None:
    """Report these paths, whose headers could not be read, as loading them would."""
    uses = _uses(description)
    for file in uses:
        for _, path in _images(file):
            if path in unreadable and not isinstance(error := _load(file, path, uses[file], read), Texture):
                _note_unreadable(error, uses[file], diagnostics)


def _load(
    file: TextureFile,
    path: str,
    use: Use,
    read: ReadAsset | None,
    default_wrap: Wrap = Wrap.BLACK,
    cache: TileCache | None = None,
) -> Texture | AssetError | LimitError:
    try:
        with span("read an image", file=path):
            if cache is not None and use.light is None:  # lights need all texels, for their power
                return cache.load(file, path, frozenset(use.channels), read, default_wrap)
            return load_texture(file, read, path=path, channels=frozenset(use.channels), default_wrap=default_wrap)
    except (AssetError, LimitError) as error:
        return error


def _uses(description: SceneDescription) -> dict[TextureFile, Use]:
    uses: dict[TextureFile, Use] = {}
    for light in description.lights:
        if light.texture is not None:
            use = uses.setdefault(light.texture, Use())
            use.channels |= set("rgb")
            use.light = use.light or light.path
            use.without = "it shines without its texture" if light.type is LightType.RECT else LIGHT_LEFT_OUT
    for surface in description.surfaces:
        for _, reads in surface.inputs:
            if isinstance(reads, TextureInput) and reads.file.path:
                use = uses.setdefault(reads.file, Use())
                use.channels |= set(reads.channels)
                use.surface = use.surface or surface.path
        for file, channels in pattern_files(surface.pattern).items() if surface.pattern else ():
            use = uses.setdefault(file, Use())
            use.channels |= channels
            use.surface = use.surface or surface.path
    return uses


def _alpha_elsewhere(uses: dict[TextureFile, Use]) -> dict[TextureFile, TextureFile]:
    """Return, for files of which only alpha is read, the same file in another colour space, which has the same alpha."""
    read_more = {_texels_of(f): f for f, use in uses.items() if use.channels != {"a"} and use.light is None}
    only_alpha = [f for f, use in uses.items() if use.channels == {"a"}]
    return {f: read_more[_texels_of(f)] for f in only_alpha if _texels_of(f) in read_more}


def _texels_of(file: TextureFile) -> tuple[object, ...]:
    """Return a key for a file's texels before colour conversion."""
    return file.path, file.tiles, file.layer


def _images(file: TextureFile) -> Iterator[tuple[int, str]]:
    yield from file.tiles or ((0, file.path),)


def _usable(texture: Texture, path: str, use: Use, diagnostics: Diagnostics) -> Texture:
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


def _note_unreadable(error: AssetError | LimitError, use: Use, diagnostics: Diagnostics) -> None:
    if use.light is not None:
        diagnostics.add("texture-unreadable", use.light, f"{use.without}: {error.message} ({error.where})")
    if use.surface:
        diagnostics.add("texture-unreadable", use.surface, f"the fallback is used: {error.message} ({error.where})")


FORMAT = "inputs:texture:format"


def with_read_textures(lights: Iterable[Light], textures: TextureSet, diagnostics: Diagnostics) -> tuple[Light, ...]:
    """Return the lights with textures that could be read.

    Rectangles shine without a texture that could not be read; domes are left out, since a sky is not a plain colour.
    """
    kept = []
    measure = _PhotometricScale(textures, diagnostics)
    for light in lights:
        if light.texture is None:
            kept.append(light)
        elif light.texture not in textures:
            if light.type is LightType.RECT:
                kept.append(measure.measured(replace(light, texture=None)))
        elif light.type is LightType.DOME:
            kept.append(measure.measured(_with_known_format(light, textures[light.texture][0][1], diagnostics)))
        else:
            kept.append(measure.measured(light))
    return tuple(kept)


class _PhotometricScale:
    """Scaling of lights to their photometric values through their images, cached for lights that differ only in placement."""

    def __init__(self, textures: TextureSet, diagnostics: Diagnostics) -> None:
        self._textures = textures
        self._diagnostics = diagnostics
        self._known: dict[Hashable, Doubles] = {}

    def measured(self, light: Light) -> Light:
        if light.photometric is None:
            return light
        found = scaled_to(light, light.photometric, self._of_one(light, light.photometric))
        if found is None:
            self._diagnostics.add("light-dark", light.path, DARK_TEXT)
            return replace(light, emission=(0.0, 0.0, 0.0), photometric=None)
        if max(found.emission) > BRIGHTEST_EMISSION:
            self._diagnostics.add("out-of-range", light.path, TOO_BRIGHT_TEXT)
        return clamped(found)

    def _of_one(self, light: Light, wanted: Photometric) -> Doubles:
        stands = light.world_from_light[:3, :3].tobytes() if light.type is LightType.DOME else shape_key(light)
        key = (light.texture, light.texture_format, light.type, light.shaping, wanted.distance, wanted.up, stands)
        if key not in self._known:
            image = None if light.texture is None else self._textures[light.texture][0][1].rgb()
            self._known[key] = amount_of_unit_emission(light, wanted, image)
        return self._known[key]


def _with_known_format(dome: Light, image: Texture, diagnostics: Diagnostics) -> Light:
    """Return the dome with the format that "automatic" stands for: what the file's metadata say, else by its aspect ratio."""
    height, width, _ = image.shape
    asked = dome.texture_format
    if asked != "automatic":
        _note_shape(dome, width, height, diagnostics)
        return dome
    if image.environment == "cube":
        message = "The file is an OpenEXR cube map, which is not supported: it is read as lat-long."
        diagnostics.add("light-input", dome.path, message, FORMAT)
    elif not image.environment:
        if 4 * width == 3 * height:
            return replace(dome, texture_format="cubeMapVerticalCross")
        if width == height > 1:
            message = (
                "The image is square and its metadata have no layout: it is read as lat-long, not mirroredBall or angular."
            )
            diagnostics.add("light-input", dome.path, message, FORMAT)
    return replace(dome, texture_format="latlong")


def _note_shape(dome: Light, width: int, height: int, diagnostics: Diagnostics) -> None:
    shapes = {"mirroredBall": (1, 1), "angular": (1, 1), "cubeMapVerticalCross": (3, 4)}
    across, down = shapes.get(dome.texture_format, (width, height))
    if width * down != height * across:
        message = f"The image is {width} x {height}, but {dome.texture_format} is {across} to {down}: it is stretched to that."
        diagnostics.add("light-input", dome.path, message, FORMAT)
