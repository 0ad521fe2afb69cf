"""UsdRenderProduct: checked values of one product; those that it does not author come from its UsdRenderSettings.

No USD schema defines driver parameters of products and variables: those that an EXR can have are applied. Houdini writes
driver:parameters:OpenEXR:NAME and driver:parameters:NAME (husk's manual, "Image output"), on variables
driver:parameters:aov:NAME; RenderMan reads driver:parameters:openexr:NAME (hdPrman), Arnold arnold:driver_exr:NAME and
arnold:NAME (arnold-usd, driver_exr). Names without a meaning for a driver become attributes of the EXR header, there and here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from pxr import Usd

from ...aovs import data_type_of
from ...description.picture_file import COMPRESSIONS, OTHER_EXTENSIONS, PLAIN, HeaderValue, PictureFile, is_free_in_header
from ...diagnostics import Diagnostics
from ...settings import PURPOSES, WHOLE
from ...settings.stage_settings import NOTHING_ASKED, StageSettings
from ..stage.reads import authored_attributes, property_names, targets, type_name
from ..stage.values import When, flag, value
from .stage_settings import PREFIX, VARIABLES, read_stage_settings, report_unknown_names

PREFIXES = ("driver:parameters:openexr:", "driver:parameters:", "arnold:driver_exr:", "arnold:")
VARIABLE_PREFIXES = ("driver:parameters:aov:husk:", "driver:parameters:aov:")
UNSUPPORTED_CODE = "output-parameter"
LEVELS = frozenset({"dwa_compression_level", "dwacompressionlevel", "compressionlevel", "compression_level"})
PIXEL_TYPES = frozenset({"pixeltype", "pixel_type", "exrpixeltype", "type"})
HALF_PRECISION = "half_precision"
# Fixed properties of files here; other values are reported.
FIXED_VALUES = {"multipart": True, "asrgba": True, "tiled": False, "autocrop": False, "storage": "scanline", "append": False}
_SILENT = frozenset({"multisampled"})  # on variables; without effect on a file of pixels


class _DriverReader:
    def __init__(self, prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> None:
        self.prim, self.when, self.diagnostics = prim, when, diagnostics

    def parameters(self, prefixes: tuple[str, ...]) -> Iterator[tuple[str, str, Any]]:
        """Yield the attribute's name, the parameter's name and its value, for parameters with a value."""
        for attribute in authored_attributes(self.prim):
            name = attribute.GetName()
            prefix = next((p for p in prefixes if name.lower().startswith(p)), None)
            if prefix is not None and (found := value(attribute, self.when)) is not None:
                yield name, name[len(prefix) :], found

    def refuse(self, attribute: str, found: object, why: str) -> None:
        message = f"{attribute} = {found!r} {why}."
        self.diagnostics.add("render-settings-input", str(self.prim.GetPath()), message, attribute)

    def leave(self, attribute: str, found: object, why: str) -> None:
        self.diagnostics.add(UNSUPPORTED_CODE, str(self.prim.GetPath()), f"{attribute} = {found!r}: {why}.", attribute)


def read_product_file(product: Usd.Prim, name: str, when: When, diagnostics: Diagnostics) -> PictureFile:
    """Return the file settings of a product; `name` is its productName, whose extension need not be the file's."""
    if PurePosixPath(name).suffix.lower() in OTHER_EXTENSIONS:  # a file with any other extension is an EXR
        return _plain_file(product, when, diagnostics)
    reader = _DriverReader(product, when, diagnostics)
    compression, level, half, header = "", None, tuple[str, ...](), dict[str, HeaderValue]()
    for attribute, name, found in reader.parameters(PREFIXES):
        key = name.lower()
        if key == "compression":
            compression = _compression(reader, attribute, found) or compression
        elif key in LEVELS:
            level = _level(reader, attribute, found, level)
        elif key in PIXEL_TYPES or key == HALF_PRECISION:
            half = ("all",) if _is_half(reader, attribute, key, found) else half
        elif key in FIXED_VALUES:
            if found != FIXED_VALUES[key]:
                reader.leave(attribute, found, f"files here always have {FIXED_VALUES[key]}")
        elif attribute.lower().startswith("arnold:"):
            reader.leave(attribute, found, "only Arnold uses it")
        else:
            _add_to_header(reader, attribute, name, found, header)
    return PictureFile(half, compression, level, tuple(header.items()))


def _plain_file(product: Usd.Prim, when: When, diagnostics: Diagnostics) -> PictureFile:
    """Report all driver parameters of a file that is no EXR: other formats have none of them."""
    reader = _DriverReader(product, when, diagnostics)
    for attribute, _, found in reader.parameters(PREFIXES):
        reader.leave(attribute, found, "only EXR files have this")
    return PictureFile()


def _compression(reader: _DriverReader, attribute: str, found: object) -> str:
    name = str(found).lower().removesuffix("_compression")
    if name not in COMPRESSIONS:
        reader.refuse(attribute, found, f"is not a known compression ({', '.join(COMPRESSIONS)}): zip is used")
        return ""
    return name


def _level(reader: _DriverReader, attribute: str, found: object, before: float | None) -> float | None:
    if isinstance(found, int | float) and math.isfinite(found) and 0 <= found <= 1e6:
        return float(found)
    reader.refuse(attribute, found, "is not a compression level: the default is used")
    return before


def _is_half(reader: _DriverReader, attribute: str, key: str, found: object) -> bool:
    if key == HALF_PRECISION and isinstance(found, bool | int):
        return bool(found)
    if found in ("half", "float"):
        return bool(found == "half")
    reader.leave(attribute, found, "only half and float are supported: the variables' own types are used")
    return False


def _add_to_header(reader: _DriverReader, attribute: str, name: str, found: object, header: dict[str, HeaderValue]) -> None:
    made = _header_value(found)
    if not is_free_in_header(name):
        reader.leave(attribute, found, "the header has the picture's own value for this")
    elif made is None:
        reader.leave(attribute, found, "headers hold text, numbers, and vectors of two to four numbers")
    else:
        header[name] = made


def _header_value(found: Any) -> HeaderValue | None:
    if isinstance(found, str):
        return found
    if isinstance(found, bool | int):
        return int(found) if -(2**31) <= found < 2**31 else None
    if isinstance(found, float):
        return found if math.isfinite(found) else None
    try:
        numbers = np.asarray(found)
    except (TypeError, ValueError):
        return None
    if numbers.ndim != 1 or not 2 <= len(numbers) <= 4 or numbers.dtype.kind not in "fiu" or not np.isfinite(numbers).all():
        return None
    kind = int if numbers.dtype.kind in "iu" else float
    return tuple(kind(number) for number in numbers.tolist())


def read_variable_parameters(variable: Usd.Prim, when: When, diagnostics: Diagnostics) -> dict[str, str]:
    """Return the usable name, channel_prefix and format of a variable; report other parameters."""
    reader, found = _DriverReader(variable, when, diagnostics), dict[str, str]()
    for attribute, name, given in reader.parameters(VARIABLE_PREFIXES):
        key = name.lower()
        if key in ("name", "channel_prefix", "format"):
            if not isinstance(given, str) or (key == "format" and given and data_type_of(given) is None) or not _is_text(given):
                reader.refuse(attribute, given, "cannot be used: the variable's own value is used")
            elif given or key == "channel_prefix":
                found.setdefault(key, given)
        elif key == "clearvalue":
            if np.any(np.asarray(given, dtype=object) != 0):
                reader.leave(attribute, given, "the background's depth is infinite, and everything else is 0")
        elif key not in _SILENT:
            reader.leave(attribute, given, "it has no effect here")
    return found


def _is_text(given: str) -> bool:
    return len(given) <= 255 and given.isprintable()


Window = tuple[float, float, float, float]
DEEP_RASTER = "deepRaster"
POLICIES = ("expandAperture", "cropAperture", "adjustApertureWidth", "adjustApertureHeight", "adjustPixelAspectRatio")
SOURCE_TYPES = ("raw", "primvar", "lpe", "intrinsic")
MOST_VARIABLES = 1000


@dataclass(frozen=True)
class RenderVariable:
    """A UsdRenderVar: a group of channels in a product; the defaults are the schema's."""

    path: str
    name: str  # the driver's, else the prim's: "drives the name of the data variable that the renderer will produce"
    data_type: str = "color3f"
    source_name: str = ""
    source_type: str = "raw"
    errors: bool = False  # primray:errors
    prefix: str | None = None  # of its channels, instead of its name


@dataclass(frozen=True, kw_only=True)
class ProductSettings:
    """Settings of one product; defaults are UsdRenderSettingsBase's, or None for a stage without RenderSettings."""

    path: str = ""  # of the RenderProduct; "": the settings have none, so the product is the picture alone
    settings_path: str = ""  # of the RenderSettings; "": the stage has none
    name: str = ""  # productName as authored; product_name.safe_product_name makes a file's name of it
    type: str = "raster"  # or "deepRaster"
    camera: str | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: str = "expandAperture"
    data_window: Window = WHOLE  # left, bottom, right, top; (0, 0) is the picture's lower left corner, (1, 1) its upper right
    disable_motion_blur: bool = False
    instantaneous_shutter: bool = False  # closes when it opens
    disable_depth_of_field: bool = False
    purposes: tuple[str, ...] = ("default", "render")
    material_purposes: tuple[str, ...] = ("full", "")
    rendering_color_space: str | None = None
    variables: tuple[RenderVariable, ...] = ()  # in order; none: colour alone
    file: PictureFile = PLAIN
    asked: StageSettings = NOTHING_ASKED  # settings of the render
    beside: tuple[ProductSettings, ...] = ()  # further products made by the same render

    @property
    def is_deep(self) -> bool:
        """Whether its file holds a deep picture."""
        return self.type == DEEP_RASTER


def read_settings_alone(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> ProductSettings:
    """Return the default product of RenderSettings without products."""
    asked, view = read_stage_settings(prim, None, when, diagnostics)
    return replace(_Reader(prim, prim, when, diagnostics).product(), asked=asked, file=PictureFile(view=view))


def read_product(settings: Usd.Prim, product: Usd.Prim, when: When, diagnostics: Diagnostics) -> ProductSettings:
    """Return a product; only values that it authors override the settings' (UsdRenderProduct)."""
    reader = _Reader(settings, product, when, diagnostics)
    name, kind = reader.own("productName", ""), reader.own("productType", "raster")
    name = name if isinstance(name, str) else ""
    if kind == DEEP_RASTER and PurePosixPath(name).suffix.lower() in OTHER_EXTENSIONS:
        message = f"productType = {kind!r} needs an EXR, but productName is {name!r}: a raster image is rendered."
        reader.note("productType", message)
        kind = "raster"
    elif kind not in ("raster", DEEP_RASTER):
        reader.note("productType", f"productType = {kind!r} is not supported: a raster image is rendered.")
        kind = "raster"
    asked, view = read_stage_settings(settings, product, when, diagnostics)
    return replace(
        reader.product(),
        path=str(product.GetPath()),
        name=name,
        type=kind,
        variables=tuple(_variables(product, when, diagnostics)),
        file=replace(read_product_file(product, name, when, diagnostics), view=view),
        asked=asked,
    )


@dataclass(frozen=True)
class _Reader:
    settings: Usd.Prim
    prim: Usd.Prim  # whose values come first: the product, or the settings themselves
    when: When
    diagnostics: Diagnostics

    def note(self, attribute: str, message: str) -> None:
        owner = self.prim if _is_authored(self.prim, attribute) else self.settings
        self.diagnostics.add("render-settings-input", str(owner.GetPath()), message, attribute)

    def own(self, name: str, default: Any) -> Any:
        found = _get(self.prim, name, self.when)
        return default if found is None else found

    def value(self, name: str) -> Any:
        return _get(self.prim if _is_authored(self.prim, name) else self.settings, name, self.when)

    def checked(self, name: str, default: Any, accept: Callable[[Any], Any], what: str) -> Any:
        """Return the value converted by `accept`; the default, with a diagnostic, if that returns None or fails."""
        raw = self.value(name)
        if raw is None:
            return default
        try:
            accepted = accept(raw)
        except (TypeError, ValueError, OverflowError):
            accepted = None
        if accepted is not None:
            return accepted
        self.note(name, f"{name} = {raw!r} is not a {what}: {default} is used.")
        return default

    def product(self) -> ProductSettings:
        return ProductSettings(
            settings_path=str(self.settings.GetPath()),
            camera=self._camera(),
            resolution=self.checked("resolution", (2048, 1080), _resolution, "picture size"),
            pixel_aspect_ratio=self.checked("pixelAspectRatio", 1.0, _ratio, "positive number"),
            conform_policy=self.checked(
                "aspectRatioConformPolicy", "expandAperture", lambda p: p if p in POLICIES else None, "known policy"
            ),
            data_window=self.checked("dataWindowNDC", WHOLE, _window, "window"),
            disable_motion_blur=self._is_set("disableMotionBlur"),
            instantaneous_shutter=self._is_set("instantaneousShutter"),
            disable_depth_of_field=self._is_set("disableDepthOfField"),
            purposes=self._purposes(),
            material_purposes=self._material_purposes(),
            rendering_color_space=self._rendering_color_space(),
        )

    def _is_set(self, name: str) -> bool:
        return bool(self.checked(name, False, lambda v: bool(v) if isinstance(v, bool | int) else None, "truth value"))

    def _camera(self) -> str | None:
        for prim in (self.prim, self.settings):
            cameras = targets(prim, "camera")
            if len(cameras) > 1:
                message = f"Only the first of its {len(cameras)} cameras is used."
                self.diagnostics.add("render-settings-input", str(prim.GetPath()), message, "camera")
            if cameras:
                return str(cameras[0])
        return None

    def _purposes(self) -> tuple[str, ...]:
        names = _tokens(_get(self.settings, "includedPurposes", self.when))
        if names is None:
            return ("default", "render")
        unknown = [name for name in names if name not in PURPOSES]
        if unknown:
            self.note(
                "includedPurposes", f"includedPurposes names {', '.join(unknown)}, which are not purposes: they are ignored."
            )
        if not names:
            self.note("includedPurposes", "includedPurposes names no purpose at all: no geometry is rendered.")
        return tuple(name for name in names if name in PURPOSES)

    def _material_purposes(self) -> tuple[str, ...]:
        """Return the material purposes; some writers author the token "allPurpose" for the empty one."""
        names = _tokens(_get(self.settings, "materialBindingPurposes", self.when))
        if names is None:
            return ("full", "")
        if not names:
            self.note("materialBindingPurposes", "materialBindingPurposes names no purpose at all: no material is bound.")
        return tuple("" if name == "allPurpose" else name for name in names)

    def _rendering_color_space(self) -> str | None:
        found = _get(self.settings, "renderingColorSpace", self.when)
        return found if isinstance(found, str) and found else None


def _variables(product: Usd.Prim, when: When, diagnostics: Diagnostics) -> Iterable[RenderVariable]:
    stage, path = product.GetStage(), str(product.GetPath())
    ordered = targets(product, "orderedVars")
    if len(ordered) > MOST_VARIABLES:
        message = f"Only the first {MOST_VARIABLES} of its {len(ordered)} variables are used."
        diagnostics.add("render-settings-input", path, message, "orderedVars")
    for target in ordered[:MOST_VARIABLES]:
        prim = stage.GetPrimAtPath(target)
        if not prim or type_name(prim) != "RenderVar":
            diagnostics.add(
                "render-settings-input",
                path,
                f"orderedVars names {target}, which is not a RenderVar: it is ignored.",
                "orderedVars",
            )
            continue
        yield read_variable(prim, when, diagnostics)


def read_variable(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> RenderVariable:
    """Read a UsdRenderVar; its data type is checked where it is used."""

    def text(name: str, default: str) -> str:
        found = _get(prim, name, when)
        return found if isinstance(found, str) else default

    kind = text("sourceType", "raw")
    if kind not in SOURCE_TYPES:
        message = f"sourceType = {kind!r} is unknown: raw is used."
        diagnostics.add("render-settings-input", str(prim.GetPath()), message, "sourceType")
        kind = "raw"
    source, errors = text("sourceName", ""), flag(prim, f"{PREFIX}errors", when, False, diagnostics)
    report_unknown_names(prim, property_names(prim), VARIABLES, diagnostics)
    own = read_variable_parameters(prim, when, diagnostics)
    name, data_type = own.get("name", prim.GetName()), own.get("format") or text("dataType", "color3f")
    return RenderVariable(
        path=str(prim.GetPath()),
        name=name,
        data_type=data_type,
        source_name=source,
        source_type=kind,
        errors=errors,
        prefix=own.get("channel_prefix"),
    )


def _get(prim: Usd.Prim, name: str, when: When) -> Any:
    attribute = prim.GetAttribute(name)
    return value(attribute, when) if attribute else None


def _is_authored(prim: Usd.Prim, name: str) -> bool:
    attribute = prim.GetAttribute(name)
    return bool(attribute and attribute.HasAuthoredValue())


def _tokens(raw: Any) -> tuple[str, ...] | None:
    if raw is None or isinstance(raw, str):
        return None
    try:
        names = tuple(raw)
    except TypeError:
        return None
    return names if all(isinstance(name, str) for name in names) else None


def _resolution(raw: Any) -> tuple[int, int] | None:
    width, height = (int(side) for side in raw)
    return (width, height) if width > 0 and height > 0 else None


def _ratio(raw: Any) -> float | None:
    """Return the aspect ratio; None beyond a million to one, which is a mistake and loses precision."""
    return float(raw) if 1e-6 < float(raw) < 1e6 else None


def _window(raw: Any) -> Window | None:
    left, bottom, right, top = (float(side) for side in raw)
    finite = all(map(math.isfinite, (left, bottom, right, top)))
    return (left, bottom, right, top) if finite and left < right and bottom < top else None
