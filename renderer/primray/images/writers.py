"""Picture writers based on OpenImageIO: EXR parts and headers, integer views, and scene-linear pictures in other formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..aovs import CRYPTOMATTES
from ..arrays import Doubles, Floats
from ..color.color_space import REC709, ColorSpace, matrix, named, transformed
from ..description import Camera, Frame, Projection
from ..description.picture_file import LOSSY, Contents, HeaderValue, PictureFile
from ..errors import PrimrayError
from ..textures.image_errors import last_error
from .encoding import Part

LARGEST_RGBE = np.float32(2.0**127 * 255 / 256)


def write_parts_of(path: str, parts: Sequence[Part]) -> None:
    """Write an EXR of these parts; PrimrayError ("write-failed") if OpenImageIO cannot."""
    import OpenImageIO as oiio

    out = oiio.ImageOutput.create(path)
    if out is None:
        raise PrimrayError(f"the file cannot be written: {last_error(oiio)}", where=path, code="write-failed")
    specs = [spec for spec, _ in parts]
    done = out.open(path, specs) if len(specs) > 1 else out.open(path, specs[0])
    for number, (spec, values) in enumerate(parts):
        done = done and (number == 0 or out.open(path, spec, "AppendSubimage")) and out.write_image(values)
    if not done or not out.close():
        raise PrimrayError(f"the file cannot be written: {last_error(out)}", where=path, code="write-failed")


# Of zlib, and libpng's PNG_FILTER_NONE: of a picture with noise a quarter of the time of level 6 with all filters, and 5 %
# larger.
QUICK_PNG = (("png:compressionLevel", 3), ("png:filter", 8))


def write_view(encoded: npt.NDArray[Any], path: str, quality: int = 95, *, is_quick: bool = False) -> None:
    """Write display values (H, W, C) unchanged, 8 or 16 bits by their type.

    `quality` of formats that lose some is up to 100; `is_quick`: a PNG is compressed quickly.
    """
    import OpenImageIO as oiio

    height, width, channels = encoded.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT16 if encoded.dtype == np.uint16 else oiio.UINT8)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("CompressionQuality", quality)
    for name, value in QUICK_PNG if is_quick else ():
        spec.attribute(name, value)
    write_parts_of(path, [(spec, encoded)])


def write_radiance(pixels: Floats, space: ColorSpace, path: str) -> None:
    """Write (H, W, 4) over black as RGBE. Readers assume Rec.709: no alpha, no negative values, 8 bits of mantissa."""
    rgb = transformed(np.where(np.isfinite(pixels[..., :3]), pixels[..., :3], np.float32(0)), matrix(space, REC709))
    _write_floats(np.clip(rgb, 0, LARGEST_RGBE), path)


def write_linear(pixels: Floats, space: ColorSpace, path: str) -> None:
    """Write (H, W, 4) as 32-bit floats in Rec.709, the space assumed of files that do not name one; alpha is associated."""
    rgb = transformed(pixels[..., :3], matrix(space, REC709))
    _write_floats(np.concatenate([rgb, pixels[..., 3:]], axis=2), path)


def _write_floats(values: Floats, path: str) -> None:
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], oiio.FLOAT)
    spec.attribute("oiio:ColorSpace", REC709.name)
    write_parts_of(path, [(spec, np.ascontiguousarray(values, np.float32))])


# SMPTE ST 2065-1 (AP0) and the ACEScg specification S-2014-004 (AP1), relative to the ACES white point.
_ACES_WHITE = (0.32168, 0.33767)
_ACES_CHROMATICITIES = {
    "lin_ap0_scene": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), _ACES_WHITE),
    "lin_ap1_scene": ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044), _ACES_WHITE),
}


def place_pixels(spec: Any, frame: Frame | None) -> None:
    """Set the data and display windows, and the pixel aspect ratio."""
    spec.attribute("PixelAspectRatio", 1.0 if frame is None else frame.pixel_aspect_ratio)
    if frame is not None:
        spec.x, spec.y = frame.pixels.x, frame.pixels.y
        spec.full_x = spec.full_y = 0
        spec.full_width, spec.full_height = frame.resolution


def describe_colors(spec: Any, space: ColorSpace) -> None:
    """Set the interop id, if the space has one, and the chromaticities.

    ACES spaces get those of their standards, as readers expect.
    """
    import OpenImageIO as oiio

    spec.attribute("oiio:ColorSpace", space.name)
    if named(space.name) == space:
        spec.attribute("colorInteropID", space.name)
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), chromaticities_of(space))


def chromaticities_of(space: ColorSpace) -> tuple[float, ...]:
    """Return x, y of red, green, blue and white, as stored in a file."""
    known = named(space.name) == space
    corners = _ACES_CHROMATICITIES.get(space.name, space.gamut) if known else space.gamut
    return tuple(float(x) for corner in corners for x in corner)


def exr_matrices(camera: Camera) -> tuple[Doubles, Doubles]:
    """Return worldToCamera and worldToNDC as OpenEXR's ImfStandardAttributes.h defines them, for column vectors.

    Its camera space is left-handed (objects in front have positive z); its NDC has (0, 0) upper left, (1, 1) lower right.
    """
    camera_from_world = np.diag([1.0, 1.0, -1.0, 1.0]) @ np.linalg.inv(camera.world_from_camera)
    left, right, bottom, top = camera.window
    near, far = camera.clipping_range
    depth = np.array([0.0, 0.0, far / (far - near), -far * near / (far - near)])
    x, y = np.array([1.0, 0, 0, 0]), np.array([0, 1.0, 0, 0])
    if camera.projection is Projection.PERSPECTIVE:
        w = np.array([0.0, 0.0, 1.0, 0.0])
    else:
        w = np.array([0.0, 0.0, 0.0, 1.0])
        depth = np.array([0.0, 0.0, 1.0, -near]) / (far - near)
    ndc_from_camera = np.stack([(x - left * w) / (right - left), (top * w - y) / (top - bottom), depth, w])
    return camera_from_world, ndc_from_camera @ camera_from_world


def row_vector_floats(matrix: Doubles) -> tuple[float, ...]:
    return tuple(float(v) for v in matrix.T.ravel())


SOURCE = "primray:source"  # header attribute of an AOV's part
DENOISED, DIFFUSED = "denoised", "diffused"
COLORS = ("R", "G", "B", "A")


def as_ordered(parts: Sequence[Part], contents: Contents) -> list[Part]:
    """Return the parts that a product orders, or all if none are.

    The picture comes first, preceded by the denoised one, since viewers open the first part.
    """
    (picture, values), *beside = parts
    made = {spec.get_string_attribute(SOURCE): (spec, own) for spec, own in beside}
    outputs = [(spec, own) for spec, own in beside if spec.get_string_attribute(SOURCE) not in (DENOISED, DIFFUSED)]
    wanted = [name for name in picture.channelnames if name.partition(".")[0] in contents.picture]
    found = list[Part]()
    if any(name in COLORS for name in wanted):
        if DENOISED in made:
            found.append(_denoised_first(*made[DENOISED], wanted))
        found.append(_with_channels(picture, values, wanted))
    elif wanted:
        found.append(_with_channels(picture, values, wanted))
    found += outputs
    if DIFFUSED in made and any(name in COLORS for name in wanted):
        found.append(made[DIFFUSED])
    if not found:
        return list(parts)
    if not wanted:
        _copy_header(picture, [spec for spec, _ in found])
    return found


def _denoised_first(spec: Any, values: npt.NDArray[Any], wanted: Sequence[str]) -> Part:
    """Return the denoised part with the channel names of a picture."""
    spec, values = _with_channels(spec, values, [f"{DENOISED}.{name}" for name in wanted if name in COLORS])
    spec.channelnames = tuple(name.removeprefix(f"{DENOISED}.") for name in spec.channelnames)
    return spec, values


def _with_channels(spec: Any, values: npt.NDArray[Any], names: Sequence[str]) -> Part:
    import OpenImageIO as oiio

    numbers = [spec.channelnames.index(name) for name in names if name in spec.channelnames]
    made = oiio.ImageSpec(spec)
    made.nchannels, made.channelnames, made.channelformats = len(numbers), tuple(spec.channelnames[n] for n in numbers), ()
    made.alpha_channel = made.channelnames.index("A") if "A" in made.channelnames else -1
    return made, np.ascontiguousarray(values[..., numbers])


def _copy_header(picture: Any, specs: Sequence[Any]) -> None:
    """Copy the render's header entries from the picture's part to the first of `specs`.

    Chromaticities are copied too if another part has them, since OpenEXR then requires them in the first part.
    """
    first, own = specs[0], {attribute.name for attribute in specs[0].extra_attribs}
    is_colored = any(spec.getattribute("chromaticities") is not None for spec in specs)
    for attribute in picture.extra_attribs:
        is_wanted = attribute.name.startswith("primray:") or (is_colored and attribute.name == "chromaticities")
        if is_wanted and attribute.name not in own:
            first.attribute(attribute.name, attribute.type, attribute.value)


def store_as_product(parts: Sequence[Part], file: PictureFile) -> None:
    """Set compression and header attributes in the specs.

    Ids (Cryptomatte and integers) are never stored with lossy compression.
    """
    text = file.compression or "zip"
    if file.level is not None:
        text += f":{file.level:g}"
    for spec, values in parts:
        exact = values.dtype.kind != "f" or spec.get_string_attribute(SOURCE) in CRYPTOMATTES
        if not (exact and file.compression in LOSSY):
            spec.attribute("compression", text)
        for name, value in file.header:
            _add(spec, name, value)


def _add(spec: object, name: str, value: HeaderValue) -> None:
    import OpenImageIO as oiio

    assert isinstance(spec, oiio.ImageSpec)
    if isinstance(value, tuple):
        is_whole = len(value) < 4 and all(
            isinstance(number, int) for number in value
        )  # OpenEXR has no vectors of four integers
        spec.attribute(name, oiio.TypeDesc(f"{'int' if is_whole else 'float'}[{len(value)}]"), value)
    else:
        spec.attribute(name, value)
