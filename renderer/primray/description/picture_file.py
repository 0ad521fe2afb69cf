"""Options of the EXR file that a stage's render product asks for: pixel encoding and header attributes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
OTHER_EXTENSIONS = (".hdr", ".png", ".jpg", ".jpeg", ".tif", ".tiff")  # extensions of files other than EXR that can be written
LOSSY = frozenset({"pxr24", "b44", "b44a", "dwaa", "dwab"})
# Header attributes that OpenEXR itself interprets (ImfStandardAttributes.h, "Required"), and those written here.
_RESERVED = """channels compression datawindow displaywindow lineorder pixelaspectratio screenwindowcenter screenwindowwidth
    tiles type name view multiview version chunkcount maxsamplesperpixel chromaticities colorinteropid worldtocamera
    worldtondc"""
RESERVED = frozenset(_RESERVED.split())
_NAME = re.compile(r"[A-Za-z_][\w.:/ -]{0,254}")
HeaderValue = str | int | float | tuple[int, ...] | tuple[float, ...]


def is_free_in_header(name: str) -> bool:
    """Return whether an EXR header attribute may have this name: it is well-formed, and neither OpenEXR nor this file uses
    it."""
    is_said = name.replace(":", "").lower() in RESERVED or name.lower().startswith(("primray:", "cryptomatte"))
    return _NAME.fullmatch(name) is not None and not is_said


@dataclass(frozen=True)
class Contents:
    """Contents of a file as a product orders them: channels of the picture ("R" to "A"; "stderr": its standard errors), and the
    other outputs as pairs of part name and the name of the output in the image."""

    picture: tuple[str, ...] = ()
    parts: tuple[tuple[str, str], ...] = ()
    is_deep: bool = False  # the deep picture alone

    def as_json(self) -> dict[str, Any]:
        values: dict[str, Any] = {"picture": list(self.picture), "parts": [list(part) for part in self.parts]}
        return values | ({"deep": True} if self.is_deep else {})


@dataclass(frozen=True)
class PictureView:
    """OpenColorIO view for files of display values; None means OpenColorIO's default."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float = 0.0  # in stops

    @property
    def is_default(self) -> bool:
        return self.view is None and self.display is None and self.look is None


@dataclass(frozen=True)
class PictureFile:
    """EXR options. `half` names channels, layers and parts as files.encoding.Encoding does; `header` has attributes by name."""

    half: tuple[str, ...] = ()
    compression: str = ""  # OpenEXR's name; "": zip
    level: float | None = None  # for zip and DWA
    header: tuple[tuple[str, HeaderValue], ...] = ()
    contents: Contents | None = None  # None: everything in the image
    products: tuple[tuple[str, PictureFile], ...] = ()  # by path: files of the products that the image is for
    lit_behind: bool = False  # there may be light where nothing covers the picture, so views of it have no alpha
    view: PictureView = PictureView()

    def beside(self) -> PictureFile:
        """Return the options that also apply to another picture of the same view, such as a denoised one."""
        return PictureFile(lit_behind=self.lit_behind, view=self.view)

    def as_json(self) -> dict[str, Any]:
        values: dict[str, Any] = {"half": list(self.half), "compression": self.compression, "level": self.level}
        values["header"] = dict(self.header)
        if self.contents is not None:
            values["contents"] = self.contents.as_json()
        if self.products:
            values["products"] = [[path, file.as_json()] for path, file in self.products]
        if self.lit_behind:
            values["lit_behind"] = True
        if self.view != PictureView():
            values["view"] = asdict(self.view)
        return values


PLAIN = PictureFile()


def picture_file_of_json(values: Mapping[str, Any]) -> PictureFile:
    """Return the options from the JSON made by `as_json`; raises TypeError or ValueError for anything else."""
    level, compression, half = values["level"], values["compression"], tuple(values["half"])
    if compression not in ("", *COMPRESSIONS) or not all(isinstance(name, str) for name in half):
        raise ValueError
    header = {
        str(name): tuple(map(_number, given)) if isinstance(given, list) else _plain(given)
        for name, given in values["header"].items()
    }
    return PictureFile(
        half=half,
        compression=compression,
        level=None if level is None else float(_number(level)),
        header=tuple(header.items()),
        contents=None if values.get("contents") is None else _contents(values["contents"]),
        products=tuple((str(path), picture_file_of_json(file)) for path, file in values.get("products", ())),
        lit_behind=values.get("lit_behind") is True,
        view=_view(values.get("view", {})),
    )


def _view(values: Mapping[str, Any]) -> PictureView:
    names = {name: values.get(name) for name in ("view", "display", "look")}
    if not all(name is None or isinstance(name, str) for name in names.values()):
        raise ValueError
    return PictureView(**names, exposure=float(_number(values.get("exposure", 0.0))))


def _contents(values: Mapping[str, Any]) -> Contents:
    return Contents(
        tuple(map(str, values["picture"])),
        tuple((str(name), str(key)) for name, key in values["parts"]),
        values.get("deep") is True,
    )


def _number(given: object) -> int | float:
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        raise ValueError
    return given


def _plain(given: object) -> str | int | float:
    return given if isinstance(given, str) else _number(given)
