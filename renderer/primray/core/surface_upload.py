"""Upload of surfaces, and of the primvars and textures that their inputs read, to the core's scene builder.

A texture in the core holds one channel, or three, of a file. Channels that no input reads are not kept, and alpha is stored as
exactly as it was read, whatever precision the colours need. Cut-outs have a texture of their own, with the finest level only.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..description import Input, PatternInput, Primvar, Surface, TextureFile, TextureInput, Wrap
from ..textures.texture import Texture
from . import compiled
from .dome_look import DomeLook
from .inputs import filled, surface_input
from .patterns.tape_upload import SharedInputs, TooLargeError, UnknownNodeError, tape_of
from .tiled_textures import ImageOfScene, TiledTextures

Textures = Mapping[TextureFile, Sequence[tuple[int, Texture]]]  # tile numbers, or 0 for a file that is no set of tiles
MutableTextures = MutableMapping[TextureFile, list[tuple[int, Texture]]]

ReadFiles = Callable[[Collection[TextureFile]], Textures]
OnFile = Callable[[int, int], None]

DIRECTIONS = ("normal", "tangent")  # inputs that have no constant form
NORMAL_ST = "st"  # the primvar that spans the tangents of a normal input which is no texture


def is_cutout(surface: Surface) -> bool:
    """Return whether rays must look up opacity at each hit; a constant opacity needs no lookup."""
    return surface.opacity_threshold > 0 and any(name == "opacity" for name, _ in surface.inputs)


def is_hole(surface: Surface) -> bool:
    """Return whether the surface is invisible everywhere: a constant opacity below the threshold."""
    return surface.opacity_threshold > surface.opacity and not is_cutout(surface)


def is_fibre(surface: Surface) -> bool:
    """Return whether shadow rays must leave curves of the surface from within."""
    return surface.hair is not None


def with_readable_inputs(surface: Surface, textures: Textures) -> Surface:
    """Return the surface with textures that could not be read replaced by their fallbacks."""
    unreadable = [(name, i) for name, i in surface.inputs if isinstance(i, TextureInput) and not textures.get(i.file)]
    if not unreadable:
        return surface
    fallbacks = {name: channels_of(i.fallback, i.channels) for name, i in unreadable if isinstance(i, TextureInput)}
    return with_constants(surface, fallbacks)


def with_constants(surface: Surface, values: Mapping[str, tuple[float, float, float]]) -> Surface:
    """Return the surface with inputs of these names replaced by constants.

    A normal or tangent input is removed: the mesh's own is used.
    """
    constants = {
        name: value if isinstance(surface.constant(name), tuple) else value[0]
        for name, value in values.items()
        if name not in DIRECTIONS
    }
    left = tuple(item for item in surface.inputs if item[0] not in values)
    return replace(surface, inputs=left).with_constants(constants)


def without_pattern(surface: Surface) -> Surface:
    """Return the surface with every input that reads its pattern replaced by that input's fallback."""
    fallbacks = {name: repeated_to_three(i.fallback) for name, i in surface.inputs if isinstance(i, PatternInput)}
    return replace(with_constants(surface, fallbacks), pattern=None)


def channels_of(rgba: Sequence[float], channels: str) -> tuple[float, float, float]:
    """Return the numbers that an output of UsdUVTexture takes from RGBA; a single channel is repeated three times."""
    r, g, b = rgba[:3] if channels == "rgb" else [rgba["rgba".index(channels)]] * 3
    return float(r), float(g), float(b)


def repeated_to_three(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the first three of `values`, with the last one repeated where there are fewer."""
    r, g, b = (*values, *[values[-1]] * 2)[:3]
    return float(r), float(g), float(b)


def selected_channels(texture: Texture, channels: str) -> Floats:
    """Return the channels (H, W, 1 or 3) that a UsdUVTexture output reads.

    One stored channel is grey, two are grey and alpha; a missing alpha is 1.
    """
    count = texture.shape[2]
    if channels == "a" and count in (1, 3):
        return np.ones((1, 1, 1), np.float32)
    if count <= 2:
        return texture.channels(1, 2) if channels == "a" else texture.channels(0, 1)
    if channels == "rgb":
        return texture.channels(0, 3)
    at = "rgba".index(channels)
    return texture.channels(at, at + 1)


def broadcast_grey(colored: bool, pixels: Floats) -> Floats:
    """Return pixels with grey repeated in three channels if `colored`: other tiles of the set have colours."""
    return np.ascontiguousarray(np.broadcast_to(pixels, (*pixels.shape[:2], 3))) if colored else pixels


OPAQUE = Texture(np.ones((1, 1, 1), np.float32))  # in place of an alpha that a file does not have


@dataclass(frozen=True)
class TextureKey:
    file: TextureFile
    channels: str
    finest_only: bool


@dataclass(frozen=True)
class KeptImages:
    """Images of a scene that is built again, in the core, and how to read those of which other levels are asked for."""

    textures: compiled.KeptTextures
    numbers: Mapping[TextureKey, int]
    read: ReadFiles
    domes: tuple[DomeLook, ...] = ()  # that `textures` holds

    def give(self, builder: compiled.SceneBuilder, key: TextureKey, number: int) -> bool:
        """Give a texture of the builder its images, and return whether that could be done."""
        return key in self.numbers and builder.take_texture_images(number, self.textures, self.numbers[key])


class SurfaceUpload:
    """Uploads surfaces, numbering the primvar names and textures that they read; afterwards the values of those."""

    def __init__(
        self, builder: compiled.SceneBuilder | compiled.Displacer, textures: MutableTextures, frame: float = 0.0
    ) -> None:
        self._builder = builder
        self._textures = textures
        self._names: dict[str, int] = {}
        self._numbers: dict[TextureKey, int] = {}
        self._outside = SharedInputs(self._name, self._pattern_texture, self._pattern_wrap, frame)
        self.warnings: list[tuple[str, str, str]] = []  # code, prim path, message

    def name_primvars(self, names: Sequence[str]) -> dict[str, int]:
        """Number further primvar names that are read, and return their numbers; call before `add_surfaces`."""
        return {name: self._name(name) for name in names}

    def add_surfaces(self, surfaces: Sequence[Surface]) -> tuple[Surface, ...]:
        """Add surfaces to the builder, before any shape; return them as the core renders them."""
        still = (surface.without_displacement() for surface in surfaces)
        taken = tuple(self._add_surface(with_readable_inputs(s, self._textures)) for s in still)
        self._builder.set_primvar_names(len(self._names))
        return taken

    def _add_surface(self, surface: Surface) -> Surface:
        """Add one surface and return it as the core renders it."""
        tape, outputs = -1, dict[str, int]()
        if surface.pattern is not None:
            try:
                made, outputs = tape_of(surface, self._outside)
                tape = self._builder.add_tape(made)
            except (UnknownNodeError, TooLargeError) as error:
                message = f"Its shading graph cannot be computed: {error}. Inputs that read it are constant"
                self.warnings.append(("pattern-not-computed", surface.path, message))
                surface = without_pattern(surface)
        cutout = is_cutout(surface)
        sources = [self._source(name, i, cutout and name == "opacity", outputs.get(name, -1)) for name, i in surface.inputs]
        self._builder.add_surface(surface_input(surface), sources, tape)
        return surface

    def _pattern_texture(self, file: TextureFile, channels: str) -> int | None:
        return self._texture(file, channels, False) if self._textures.get(file) else None

    def _pattern_wrap(self, file: TextureFile, wrap: Wrap, axis: int) -> str:
        texture = self._textures[file][0][1]
        return ((texture.wrap_s, texture.wrap_t)[axis] if wrap is Wrap.USE_METADATA else wrap).name

    def number_of(self, name: str) -> int | None:
        """Return the number of a primvar that some surface reads, else None."""
        return self._names.get(name)

    def _name(self, name: str) -> int:
        return self._names.setdefault(name, len(self._names))

    def _source(self, field: str, value: Input, finest_only: bool, output: int) -> compiled.InputSource:
        """Return where an input's values come from."""
        source = filled(compiled.InputSource(), field=compiled.InputField[field])
        if isinstance(value, PatternInput):
            return filled(source, output=output, fallback=repeated_to_three(value.fallback))
        if not isinstance(value, TextureInput):
            filled(source, primvar=self._name(value.name), fallback=repeated_to_three(value.fallback))
            return filled(source, tangents=self._name(NORMAL_ST)) if field == "normal" else source
        texture = self._textures[value.file][0][1]
        st = self._name(value.st.name)
        return filled(
            source,
            primvar=st,
            fallback=repeated_to_three(value.st.fallback),
            texture=self._texture(value.file, value.channels, finest_only),
            wrap_s=self._wrap(value.wrap_s, texture.wrap_s),
            wrap_t=self._wrap(value.wrap_t, texture.wrap_t),
            st_transform=value.st_transform,
            scale=channels_of(value.scale, value.channels),
            bias=channels_of(value.bias, value.channels),
            missing=channels_of(value.fallback, value.channels),
            tangents=st,
        )

    def _wrap(self, wrap: Wrap, of_file: Wrap) -> compiled.Wrap:
        return compiled.Wrap[(of_file if wrap is Wrap.USE_METADATA else wrap).name]

    def _texture(self, file: TextureFile, channels: str, finest_only: bool) -> int:
        key = TextureKey(file, channels, finest_only)
        if key not in self._numbers:
            tiles = self._textures[file]
            grey = channels != "rgb" or all(texture.shape[2] <= 2 for _, texture in tiles)
            udim = any(number for number, _ in tiles)
            self._numbers[key] = self._builder.add_texture(1 if grey else 3, udim, finest_only)
        return self._numbers[key]

    def primvars(self, primvars: Sequence[Primvar]) -> list[tuple[int, compiled.PrimvarKind, int, Floats]]:
        """Return name, kind, width and values of the primvars that some surface reads; non-finite values become 0."""
        return [
            (self._names[p.name], compiled.PrimvarKind[p.interpolation.name], width(p.values), finite(p.values))
            for p in primvars
            if p.name in self._names
        ]

    @property
    def texture_numbers(self) -> dict[TextureKey, int]:
        return dict(self._numbers)

    def add_images(
        self, kept: KeptImages | None = None, on_file: OnFile | None = None, tiled: TiledTextures | None = None
    ) -> None:
        """Add the images of all textures; call after shapes, placements, lights and the camera.

        Each file's image is released once the core has copied what it keeps. `kept` gives those that it can. `on_file` is
        called with the number of files whose images have been added, and of all. `tiled` decides which are read by tile.
        """
        if kept is None:
            self._add_images(self._numbers, on_file, tiled)
            return
        builder = self._builder
        assert isinstance(builder, compiled.SceneBuilder)
        wanted = {key: n for key, n in self._numbers.items() if not kept.give(builder, key, n)}
        self.add_read_images(wanted, kept.read, tiled)

    def add_read_images(self, wanted: Mapping[TextureKey, int], read: ReadFiles, tiled: TiledTextures | None = None) -> None:
        """Add the images of these textures from files that are read now; `tiled` as in `add_images`."""
        if wanted:
            self._textures.update({file: list(tiles) for file, tiles in read({key.file for key in wanted}).items()})
        self._add_images(wanted, tiled=tiled)

    def _add_images(
        self, wanted: Mapping[TextureKey, int], on_file: OnFile | None = None, tiled: TiledTextures | None = None
    ) -> None:
        by_file: dict[TextureFile, list[tuple[TextureKey, int]]] = {}
        for key, number in wanted.items():
            by_file.setdefault(key.file, []).append((key, number))
        if tiled is not None:
            assert isinstance(self._builder, compiled.SceneBuilder)
            images = [one for file, keys in by_file.items() for one in images_of(self._textures.pop(file), keys)]
            tiled.add(self._builder, images, floats_of, on_file)
            self.warnings.extend(tiled.take_warnings())
        else:
            for done, (file, keys) in enumerate(by_file.items()):
                if on_file is not None:
                    on_file(done, len(by_file))
                for one in images_of(self._textures.pop(file), keys):  # no variable keeps floats: one image is held at a time
                    self._builder.set_texture_image(one.texture, one.tile, floats_of(one, one.image))
        self._textures.clear()


def images_of(tiles: Sequence[tuple[int, Texture]], keys: Sequence[tuple[TextureKey, int]]) -> Iterator[ImageOfScene]:
    """Yield the images that the textures of one file have in the core."""
    colored = any(texture.shape[2] > 2 for _, texture in tiles)
    for key, number in keys:
        for tile, texture in tiles:
            is_opaque = key.channels == "a" and texture.shape[2] in (1, 3)
            is_rgb = key.channels == "rgb" and colored
            yield ImageOfScene(number, tile, OPAQUE if is_opaque else texture, key.channels, 3 if is_rgb else 1)


def floats_of(one: ImageOfScene, texture: Texture) -> Floats:
    """Return the floats (H, W, C) of an image, from its texels."""
    return broadcast_grey(one.count == 3, selected_channels(texture, one.channels))


def width(values: Floats) -> int:
    return 1 if values.ndim == 1 else values.shape[1]


def finite(values: Floats) -> Floats:
    return np.ascontiguousarray(np.where(np.isfinite(values), values, 0), np.float32)
