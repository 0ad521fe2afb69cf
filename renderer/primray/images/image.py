"""A rendered picture and its files: EXR is the record; PNG, JPEG and TIFF are views of it through OpenColorIO."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from ..arrays import Floats
from ..color.color_space import REC709, ColorSpace
from ..description import Camera, Frame
from ..description.picture_file import OTHER_EXTENSIONS, PLAIN, HeaderValue, PictureFile
from ..diagnostic_messages import Announcer, picture_html
from ..diagnostics import Diagnostic
from ..errors import PrimrayError, SettingsError
from ..read_files import note_output
from ..settings import check_stops
from .aov import Aov, Values
from .deep import DeepPicture
from .encoding import LINEAR_BITS, NONE, Encoding, half_faults, store_halves
from .exposure import View, as_viewed, exposure_that_serves, view_fault, where_lit
from .exr_parts import DENOISED, DIFFUSED, VIEW, Parts, parts_of, picture_beside
from .output_path import check_folder, name_beside, through_links
from .writers import (
    as_ordered,
    describe_colors,
    exr_matrices,
    place_pixels,
    row_vector_floats,
    store_as_product,
    write_linear,
    write_parts_of,
    write_radiance,
    write_view,
)

if TYPE_CHECKING:
    from ..labels.things import Thing

CHANNELS = ("R", "G", "B", "A")
ERROR_CHANNELS = ("stderr.R", "stderr.G", "stderr.B")
VIEW_EXTENSIONS = tuple(extension for extension in OTHER_EXTENSIONS if extension != ".hdr")
WITH_ALPHA = (".png", ".tif", ".tiff")
BACKGROUND, LIT = "primray:background", "light"  # header attribute for what is behind the picture's surfaces
MISSING_TEXTURES = ("asset-missing", "texture-unreadable", "tile-missing")
WHITE = (1.0, 1.0, 1.0)
EYE = "settings.eye"  # metadata key of the eye in a stereo pair
EXTENSIONS = (".exr", *OTHER_EXTENSIONS)


@dataclass(frozen=True, eq=False)
class Foreground:
    """Premultiplied pixels (H, W, 4) as rendered.

    `exposed` brightens such pixels by stops and composites them over the background.
    """

    pixels: Floats
    exposed: Callable[[Floats, float], Floats]


@dataclass(frozen=True, eq=False, repr=False)
class Image:
    """A scene-linear premultiplied RGBA picture, alpha = coverage, with the report of its render. Row 0 is the top.

    Values are radiance in nits times the camera's exposure, in the rendering colour space (`color_space`, Rec.709 unless said).

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=4)
    >>> image.pixels.shape, image.pixels.dtype.name, image.errors.shape
    ((18, 32, 4), 'float32', (18, 32, 3))
    >>> np.asarray(image).shape, image.to_uint8(exposure=0.5).shape
    ((18, 32, 4), (18, 32, 4))
    >>> [image.save(f"shot.{kind}").name for kind in ("exr", "png")]
    ['shot.exr', 'shot.png']

    A notebook shows it with the diagnostics of its render. ValueError if the shapes of arrays do not match.
    """

    pixels: Floats  # (H, W, 4), read-only
    report: Mapping[str, Any] = field(default_factory=dict)
    metadata: Mapping[str, str | int | float] = field(default_factory=dict)  # written to an EXR's header as primray:<name>
    camera: Camera | None = None
    channels: tuple[str, ...] = CHANNELS
    # (H, W, 3) standard errors of R, G, B, read-only; inf where a pixel has too few samples for an estimate. Each has one
    # degree of freedom: average their squares over pixels before relying on them.
    errors: Floats | None = None
    color_space: ColorSpace = REC709  # linear
    frame: Frame | None = None  # position of the pixels in the frame; None: they are the whole frame
    aovs: Mapping[str, Aov] = field(default_factory=dict)  # outputs beside the picture; each is a part of an EXR
    denoised: Image | None = None  # the denoised picture, without errors: a part of an EXR, and shown by views
    # The picture with lens diffusion and its errors, if the lens diffuses: a part of an EXR, and shown by views.
    diffused: Image | None = None
    file: PictureFile = PLAIN  # EXR settings of the stage's product
    deep: DeepPicture | None = None  # samples by depth, if requested: a file beside an EXR, or a product of its own
    foreground: Foreground | None = None  # the rendered pixels, if a background or a ground's shadow is behind them

    def __post_init__(self) -> None:
        pixels = np.array(self.pixels, np.float32, order="C")
        if pixels.ndim != 3 or pixels.shape[2] != len(self.channels):
            raise ValueError(f"pixels of shape {pixels.shape} do not hold the channels {self.channels}")
        pixels.flags.writeable = False
        object.__setattr__(self, "pixels", pixels)
        if self.errors is not None:
            errors = np.array(self.errors, np.float32, order="C")
            if errors.shape != (*pixels.shape[:2], len(ERROR_CHANNELS)):
                raise ValueError(f"errors of shape {errors.shape} do not go with pixels of shape {pixels.shape}")
            errors.flags.writeable = False
            object.__setattr__(self, "errors", errors)
        for name, aov in self.aovs.items():
            if aov.values.shape[:2] != pixels.shape[:2]:
                raise ValueError(f"{name} of shape {aov.values.shape} does not go with pixels of shape {pixels.shape}")
        for what, made in (("diffused", self.diffused), ("denoised", self.denoised)):
            if made is not None and made.resolution != self.resolution:
                raise ValueError(f"a {what} picture of {made.resolution} does not go with one of {self.resolution}")
        if self.frame is not None and self.frame.size != self.resolution:
            raise ValueError(f"pixels of shape {pixels.shape} do not fill {self.frame}")

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height of the pixels present; `frame` locates them in the whole."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def values(self) -> Floats:
        """Pixels followed by errors, if any: (H, W, C)."""
        return self.pixels if self.errors is None else np.concatenate([self.pixels, self.errors], axis=2)

    @property
    def things(self) -> tuple[Thing, ...]:
        """The labelled things of an AOV object_instance:TAXONOMY, as the report's `labels.things` has them."""
        from ..labels.things import thing_of_json

        return tuple(thing_of_json(says) for says in self.report.get("labels", {}).get("things", ()))

    def mask_of(self, thing: Thing) -> npt.NDArray[np.bool_]:
        """Return the pixels (H, W) that show a thing, or another that it holds. KeyError without the AOV of its taxonomy."""
        from ..labels.things import mask_of

        return mask_of(thing, self.things, self.aovs)

    def as_product(self, path: str) -> Image:
        """Return the image as one of its render products: `save` then writes exactly what the product orders.

        KeyError if the render was not for that product.
        """
        file = replace(dict(self.file.products)[path], lit_behind=self.file.lit_behind)  # known only to the render
        assert file.contents is not None
        aovs = {name: self.aovs[key] for name, key in file.contents.parts if key in self.aovs}
        return replace(self, aovs=aovs, file=file)

    @property
    def shown(self) -> Image:
        """The picture that views and notebooks show: the denoised or the diffused one, if there is one, else this."""
        return self.denoised or self.diffused or self

    @property
    def seen(self) -> Floats:
        """The premultiplied pixels (H, W, 4) by which an exposure is judged: as views show them, without a background."""
        record = self.pixels if self.foreground is None else self.foreground.pixels
        if self.denoised is None:
            return record if self.diffused is None or self.foreground is not None else self.diffused.pixels
        rendered = self.denoised.foreground
        return where_lit(self.denoised.pixels if rendered is None else rendered.pixels, record)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        view: str | None = None,
        display: str | None = None,
        exposure: float | Literal["auto"] | None = None,
        look: str | None = None,
        bit_depth: Literal[8, 16, 32] | None = None,
        half: Iterable[str] = (),
        compression: str = "",
        level: float | None = None,
        header: Mapping[str, HeaderValue] | None = None,
        flatten_over: tuple[float, float, float] | None = None,
    ) -> Path:
        """Write the image to `path`, atomically.

        `view`, `display`, `exposure` (stops, or "auto") and `look` are for PNG, JPEG and TIFF, which show only the picture,
        diffused if it is; None selects what the stage's product specifies, or the default. RenderWarning if the result is
        almost only white or black.

        `bit_depth` is for PNG (8 or 16) and TIFF (16, 8, or 32: scene-linear floats). `half` names what an EXR stores as
        halves: channels ("R"), layers ("stderr"), parts ("rgba", "normal") or "all"; the rest are floats. RenderWarning if a
        name matches nothing, or values exceed the range of halves. `compression` of an EXR is none, rle, zips, zip, piz,
        pxr24, b44, b44a, dwaa or dwab, with the `level` of zip and DWA; `header` adds attributes to its header. `flatten_over`
        is the display colour, in 0 to 1, under the picture in files without alpha (JPEG); None: black, or white if a ground
        shows its shadow.
        """
        path = check_output_path(path)
        chosen, encoding = (
            self.view_of(view, display, look),
            Encoding(
                bit_depth=bit_depth,
                half=tuple(half),
                compression=compression,
                level=level,
                header=tuple((header or {}).items()),
                flatten_over=flatten_over,
            ),
        )
        stops = 0.0
        if shows_view(path, encoding):
            stops = self._stops(chosen, exposure)
            faults = (chosen.assumption(), self.view_fault(chosen, stops, is_auto=exposure == "auto"))
            Announcer(path).tell([fault for fault in faults if fault is not None])
        if path.suffix.lower() == ".exr":
            Announcer(path).tell(faults_of_exr(self, encoding))
        return self.write(path, chosen, stops, encoding)

    def view_of(self, view: str | None = None, display: str | None = None, look: str | None = None) -> View:
        """Return the view with these names. If none is given, it is that of the stage's product, else the default."""
        if view is None and display is None and look is None:
            asked = self.file.view
            view, display, look = asked.view, asked.display, asked.look
        return View(view, display, look, self.color_space)

    def view_fault(self, view: View, exposure: float, *, is_auto: bool = False) -> Diagnostic | None:
        """Return the diagnostic of a view that shows almost only white or black, else None.

        Missing textures are mentioned first, since they render black.
        """
        missing = any(row["code"] in MISSING_TEXTURES for row in self.report.get("diagnostics", ()))
        return view_fault(self.seen, view, exposure, is_auto=is_auto, lacks_textures=missing)

    def write(self, path: Path, view: View, exposure: float, encoding: Encoding = Encoding()) -> Path:  # noqa: B008 - immutable
        """Write to a path that has been checked, without diagnostics; otherwise as `save`."""
        suffix = path.suffix.lower()
        if self.is_deep_alone and suffix != ".exr":
            raise SettingsError("a deep picture is an EXR: give a name that ends in .exr", where=str(path), code="deep-output")
        with replacing(path) as temporary:
            if self.is_deep_alone:
                self._write_deep(temporary, encoding)
            elif suffix == ".exr":
                _write_exr(self, temporary, encoding)
            elif suffix == ".hdr":
                write_radiance(self.shown.pixels, self.color_space, temporary)
            elif encoding.bits_of(suffix) == LINEAR_BITS:
                write_linear(self.shown.pixels, self.color_space, temporary)
            else:
                write_view(self._encoded(suffix, view, exposure, encoding), temporary, is_quick=encoding.is_quick)
        for other in self.files_beside(path):
            with replacing(other) as temporary:
                self._write_deep(temporary, encoding)
        return path

    @property
    def is_deep_alone(self) -> bool:
        """Whether its file holds the deep picture alone, as a deepRaster product does."""
        return self.file.contents is not None and self.file.contents.is_deep

    def files_beside(self, path: str | os.PathLike[str]) -> tuple[Path, ...]:
        """Return the further files that `save` writes: the deep picture beside an EXR, shot.deep.exr."""
        from .deep import beside

        held = self.deep is not None and self.file.contents is None and str(path).lower().endswith(".exr")
        return (beside(path),) if held else ()

    def _write_deep(self, path: str, encoding: Encoding) -> None:
        from .deep_exr import write_deep

        if self.deep is None:
            raise SettingsError(
                "the image has no deep picture: render it with aovs=['deep']", where="deep", code="deep-missing"
            )
        spec, _ = _picture_part(self)
        store_as_product([(spec, self.pixels)], _with_choices(self.file, encoding))
        write_deep(path, self.deep, spec)

    def _encoded(self, suffix: str, view: View, exposure: float, encoding: Encoding) -> npt.NDArray[Any]:
        keep_alpha, over = self._has_alpha and suffix in WITH_ALPHA, encoding.flatten_over
        if over is None and self.foreground is not None:
            over = WHITE
        bits, (pixels, exposure) = encoding.bits_of(suffix), self._exposed(exposure)
        if keep_alpha or over is None or self.file.lit_behind:
            return _encode(pixels, view, exposure, keep_alpha=keep_alpha, bits=bits)
        return _whole(_flattened(pixels, view, exposure, over), bits)

    @property
    def _has_alpha(self) -> bool:
        """Whether views have alpha. It depends on the product and on whether a dome is behind the picture, never on samples."""
        is_ordered = self.file.contents is None or "A" in self.file.contents.picture
        return is_ordered and not self.file.lit_behind

    def to_uint8(
        self,
        *,
        view: str | None = None,
        display: str | None = None,
        exposure: float | Literal["auto"] | None = None,
        look: str | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Return (H, W, 4) display values 0 to 255 with straight alpha: the PNG that `save` writes, opaque if it has no alpha.

        `exposure` is in stops, or "auto"; `view`, `display` and `look` are names in the OpenColorIO configuration (else
        SettingsError). None selects what the stage's product specifies, else the default.
        """
        chosen = self.view_of(view, display, look)
        pixels, stops = self._exposed(self._stops(chosen, exposure))
        encoded = _encode(pixels, chosen, stops, keep_alpha=self._has_alpha)
        opaque = np.full((*encoded.shape[:2], 4 - encoded.shape[2]), 255, np.uint8)
        return np.concatenate([encoded, opaque], axis=2)

    def _stops(self, view: View, exposure: float | Literal["auto"] | None) -> float:
        if exposure is None:
            return self.file.view.exposure
        return exposure_that_serves(self.seen, view) if exposure == "auto" else check_stops(exposure, "exposure")

    def _exposed(self, stops: float) -> tuple[Floats, float]:
        """Return the pixels to convert by a view, and the stops still to apply.

        A display-referred background does not change with the exposure of the picture in front of it.
        """
        shown = self.shown
        if shown.foreground is None or stops == 0:
            return shown.pixels, stops
        return shown.foreground.exposed(shown.foreground.pixels, stops), 0.0

    def show(self) -> None:
        """Show the image: under the cell in a notebook, else as a PNG in the desktop's viewer.

        PrimrayError if there is no desktop.
        """
        from .showing import show

        show(self)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """Return `pixels`, read-only if NumPy need not copy."""
        if copy is False and dtype is not None and np.dtype(dtype) != self.pixels.dtype:
            raise ValueError(f"float32 pixels cannot be {np.dtype(dtype)} without a copy")
        return np.array(self.pixels, dtype) if copy else np.asarray(self.pixels, dtype)

    def __repr__(self) -> str:
        width, height = self.resolution
        told = [f"{width} x {height}", "".join(self.channels)]
        low, high = self.report.get("samples_per_pixel", (0, 0))
        if high:
            told.append(f"{low} samples a pixel" if low == high else f"{low} to {high} samples a pixel")
        error = (self.report.get("error") or {}).get("relmse")
        if error is not None:
            told.append(f"relmse {error['estimate']:.2g}")
        if self.aovs:
            told.append(f"aovs {' '.join(self.aovs)}")
        told += [name for name in ("denoised", "diffused") if getattr(self, name) is not None]
        severities = [d["severity"] for d in self.report.get("diagnostics", ())]
        for severity in ("error", "warning"):
            count = severities.count(severity)
            told += [f"{count} {severity}{'s' if count > 1 else ''}"] if count else []
        return f"<Image {', '.join(told)}>"

    def _repr_html_(self) -> str | None:
        fault = self.view_fault(self.view_of(), self.file.view.exposure)
        told = [*self.report.get("diagnostics", ()), *([] if fault is None else [fault.as_json()])]
        if self.errors is None:
            return picture_html(self._repr_png_, self.resolution, told)
        from .showing import figures_of, picture_page

        shown = self.shown
        figures = figures_of(self.resolution, self.report)
        return picture_page(self._repr_png_(), shown.pixels, shown.errors, View(space=self.color_space), figures, told)

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            return self.write(Path(folder, "picture.png"), self.view_of(), self.file.view.exposure).read_bytes()


def pixels_sha256(pixels: Floats) -> str:
    """Return the SHA-256 of the decoded float channels: little-endian float32 RGBA, row by row from the top."""
    return hashlib.sha256(np.ascontiguousarray(pixels, "<f4").tobytes()).hexdigest()


def check_output_path(path: str | os.PathLike[str]) -> Path:
    """Return the path if its format is known and its folder is writable; else raise SettingsError. Called before rendering."""
    path = Path(path)
    if path.suffix.lower() not in EXTENSIONS:
        known = ", ".join(EXTENSIONS)
        raise SettingsError(f"the output's name must end in one of {known}", where=str(path), code="unknown-extension")
    if str(path) != str(path).encode("utf-8", "replace").decode():
        raise SettingsError("the output's name is not valid UTF-8", where=str(path), code="output-name")
    check_folder(path)
    return path


def encode(
    pixels: Floats,
    *,
    view: str | None = None,
    display: str | None = None,
    exposure: float = 0.0,
    look: str | None = None,
    space: ColorSpace = REC709,
) -> npt.NDArray[np.uint8]:
    """Return 8-bit display values: (H, W, 4) with straight alpha, or (H, W, 3) if the picture is opaque.

    Light without coverage (a visible dome behind everything) has no straight-alpha form: such a picture is opaque,
    composited over the black it was rendered on.
    """
    return _encode(pixels, View(view, display, look, space), exposure)


def shows_view(path: Path, encoding: Encoding) -> bool:
    """Return whether a file of this name stores the picture through a view."""
    return path.suffix.lower() in VIEW_EXTENSIONS and encoding.bits_of(path.suffix) != LINEAR_BITS


def _encode(pixels: Floats, view: View, exposure: float, *, keep_alpha: bool | None = None, bits: int = 8) -> npt.NDArray[Any]:
    """Return display values as integers of `bits` bits.

    Without alpha the picture is over black; `keep_alpha` as in `as_viewed`.
    """
    rgb, alpha = as_viewed(pixels, keep_alpha=keep_alpha)
    shown = view.shown(rgb, exposure)
    return _whole(shown if alpha is None else np.concatenate([shown, alpha], axis=2), bits)


def _flattened(pixels: Floats, view: View, exposure: float, over: tuple[float, float, float]) -> Floats:
    """Return display values (H, W, 3) composited over a display colour, as programs show pictures with alpha."""
    rgb, alpha = as_viewed(pixels, keep_alpha=True)
    assert alpha is not None
    flat: Floats = view.shown(rgb, exposure) * alpha + np.asarray(over, np.float32) * (1 - alpha)
    return flat


def _whole(shown: Floats, bits: int) -> npt.NDArray[Any]:
    most, kind = (255, np.uint8) if bits == 8 else (65535, np.uint16)
    return (np.clip(np.nan_to_num(shown), 0, 1) * most + 0.5).astype(kind)


@contextmanager
def replacing(path: Path) -> Iterator[str]:
    """Yield a temporary name beside the target of `path`; rename it to the target if the block succeeds."""
    note_output(path)  # the last chance to keep a file that has been read
    target = through_links(path)
    temporary = target.with_name(f".{name_beside(path.stem)}.{os.getpid()}.{os.urandom(4).hex()}{path.suffix}")
    try:
        yield str(temporary)
        os.replace(temporary, target)
    except PrimrayError as error:
        if error.where == str(temporary):  # a name that the user does not know
            error.where, error.message = str(path), error.message.replace(str(temporary), str(path))
        raise
    except OSError as error:
        raise PrimrayError(f"the file cannot be written: {error.strerror}", where=str(path), code="write-failed") from error
    finally:
        with suppress(OSError):  # of a folder that may not be entered, whose error is raised already
            temporary.unlink(missing_ok=True)


def write_png(encoded: np.ndarray[Any, Any], path: Path, *, is_quick: bool = False) -> Path:
    """Write 8-bit values (H, W, 3 or 4) unchanged, atomically; `is_quick` as of an Encoding."""
    with replacing(path) as temporary:
        write_view(encoded, temporary, is_quick=is_quick)
    return path


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically; bytes of file names in it that are not UTF-8 are escaped."""
    with replacing(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8", errors="backslashreplace")


def _write_exr(image: Image, path: str, encoding: Encoding) -> None:
    write_parts_of(path, stored_parts(image, encoding))


def stored_parts(image: Image, encoding: Encoding) -> Parts:
    """Return the parts of the image's EXR as stored, with the halves, compression and header of product and `encoding`."""
    parts = exr_parts(image)
    store_halves(parts, _with_halves_of_product(image, encoding))
    file = _with_choices(image.file, encoding)
    if file != PLAIN:
        store_as_product(parts, file)
    return parts


def _with_choices(file: PictureFile, encoding: Encoding) -> PictureFile:
    """Return the product's EXR settings with the user's choices in their place."""
    if encoding.compression:
        file = replace(file, compression=encoding.compression, level=encoding.level)
    if encoding.header:
        file = replace(file, header=tuple(dict((*file.header, *encoding.header)).items()))
    return file


def faults_of_exr(image: Image, encoding: Encoding) -> list[Diagnostic]:
    """Return diagnostics of values that an EXR cannot store exactly; nothing is examined if nothing is stored as halves."""
    asked = _with_halves_of_product(image, encoding)
    if image.is_deep_alone or (not asked.half and all(aov.stored != "half" for aov in image.aovs.values())):
        return []
    return half_faults(exr_parts(image), asked, encoding.half)


def _with_halves_of_product(image: Image, encoding: Encoding) -> Encoding:
    if not image.file.half or NONE in encoding.half:
        return encoding
    return replace(encoding, half=(*encoding.half, *image.file.half))


def exr_parts(image: Image) -> Parts:
    """Return specs and values of the picture and of the outputs beside it."""
    spec, values = _picture_part(image)
    beside = parts_of(spec, image.aovs)
    for name, made in ((DENOISED, image.denoised), (DIFFUSED, image.diffused)):
        if made is not None:
            beside.append(picture_beside(name, spec, made.values, made.metadata, image.aovs))
    parts = [(spec, values), *beside]
    if image.file.contents is not None:
        parts = as_ordered(parts, image.file.contents)
    eye = image.metadata.get(EYE)
    if eye is not None:
        _name_view(parts, str(eye))
    return parts


def _name_view(parts: Parts, view: str) -> None:
    """Set the view of each part as OpenEXR's "Storing Multi-View Images" specifies for a file with one of several views.

    A single part needs `multiView` as well.
    """
    for spec, _ in parts:
        spec.attribute(VIEW, view)
    if len(parts) == 1:
        parts[0][0].attribute("multiView", "string[1]", (view,))


def write_parts(path: Path, parts: Parts) -> Path:
    """Write an EXR of these parts, atomically."""
    with replacing(path) as temporary:
        write_parts_of(temporary, parts)
    return path


def _picture_part(image: Image) -> tuple[Any, Values]:
    import OpenImageIO as oiio

    width, height = image.resolution
    values = image.values
    spec = oiio.ImageSpec(width, height, values.shape[2], oiio.FLOAT)
    spec.channelnames = image.channels if image.errors is None else image.channels + ERROR_CHANNELS
    place_pixels(spec, image.frame)
    spec.attribute("compression", "zip")
    describe_colors(spec, image.color_space)
    spec.attribute(BACKGROUND, LIT if image.file.lit_behind else "nothing")
    for name, value in image.metadata.items():
        fits = not isinstance(value, int) or -(2**31) <= value < 2**31
        spec.attribute(f"primray:{name}", value if fits else str(value))
    if image.camera is not None:
        camera_matrix, ndc_matrix = exr_matrices(image.camera)
        spec.attribute("worldtocamera", oiio.TypeMatrix, row_vector_floats(camera_matrix))
        if image.camera.distortion is None:  # no matrix describes a distorted projection
            spec.attribute("worldtoNDC", oiio.TypeMatrix, row_vector_floats(ndc_matrix))
        if image.camera.environment_map and image.frame is not None and image.frame.is_whole:
            spec.attribute("textureformat", image.camera.environment_map)  # OpenEXR's envmap
    return spec, values
