"""The products of a stage's RenderSettings as renders: which there are, where each is written, and rendering all of them.

Products that differ in names and outputs only share one render.
"""

from __future__ import annotations

import os
import posixpath
import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal, Unpack

from ..description.picture_file import PLAIN, Contents, PictureView
from ..diagnostics import Diagnostic, Diagnostics
from ..errors import SettingsError
from ..images.image import EXTENSIONS
from ..settings import RenderSettings, with_values
from .frames import frame_name, with_number
from .prepare import OpenedStage, open_once, with_usable_view
from .render import rendered_frames, with_setting_names

if TYPE_CHECKING:
    from ..images.image import Image
    from ..sampling.sampling import Progress
    from ..settings.written import SettingsValues
    from ..usd import ProductSettings


STDERR = "stderr"
LONGEST_SHOWN = 80  # characters of a name in a message


@dataclass(frozen=True, kw_only=True)
class Product:
    """A picture that a stage's RenderSettings request. No other product of the stage has its `file_name`.

    >>> for product, image in primray.render_products("shot.usda", resolution=(32, 18), spp=2):
    ...     print(product.file_name, image.resolution, product.save(image, "out"))
    picture.exr (32, 18) out/picture.exr
    """

    path: str  # of the RenderProduct; "": the settings have none, and this is the default one
    name: str  # productName as authored
    file_name: str  # path from productName with the frame number, absolute or relative to a folder that the caller chooses
    settings: RenderSettings
    picture: tuple[str, ...] = ()  # channels of the picture that it requests: "R" to "A", "stderr"
    notes: tuple[Diagnostic, ...] = ()  # differences of its file name from the authored one
    view: PictureView = PLAIN.view  # view transform of files with display values

    @property
    def has_parts(self) -> bool:
        """Whether its file can hold AOVs beside the picture."""
        return self.file_name.lower().endswith(".exr")

    def image_of(self, image: Image, *, record: bool = False) -> Image:
        """Return the render's image as this product: saved, it holds what the product requests.

        `record` adds the picture and its standard errors.
        """
        if not self.path:  # the stage has no products
            return image
        notes = list(self.notes)
        if self.has_parts:
            image = image.as_product(self.path)
        else:
            found = Diagnostics()
            file = replace(image.file.beside(), contents=Contents(self.picture), view=self.view)
            image = replace(image, aovs={}, file=with_usable_view(file, image.color_space, self.path, found))
            notes += found
        if notes:
            rows = [*image.report["diagnostics"], *(note.as_json() for note in notes)]
            image = replace(image, report={**image.report, "diagnostics": rows})
        contents = image.file.contents
        if record and contents is not None and not contents.is_deep:
            image = replace(image, file=replace(image.file, contents=replace(contents, picture=("R", "G", "B", "A", STDERR))))
        return image

    def save(self, image: Image, folder: str | os.PathLike[str] = "") -> Path:
        """Write the product's image to its file name, a relative name below `folder`; missing folders are created."""
        from ..images.output_path import make_folder

        path = Path(folder, self.file_name)
        make_folder(path)
        return image.save(path)


def products_of(opened: OpenedStage, settings: RenderSettings, asked: Sequence[str] | None = None) -> list[Product]:
    """Return the products named by path or, if only one has it, by name (None: all), in the order of the stage's settings.

    The file names have placeholders for the frame's number, as authored. SettingsError if a requested product does not exist.
    """
    from .. import usd

    found = usd.products(opened.stage, settings)
    paths = [product.path for product in found]
    wanted = paths if asked is None else {usd.named_product(text, paths) for text in asked}
    chosen = [product for product in found if product.path in wanted]
    notes = Diagnostics()
    files = _distinct_paths(chosen, notes)
    made = [
        Product(
            path=p.path,
            name=p.name,
            file_name=file,
            settings=replace(settings, product=p.path or None),
            picture=usd.ordered_picture_channels(p, settings),
            notes=tuple(note for note in notes if note.prim_path == p.path),
            view=p.file.view,
        )
        for p, file in zip(chosen, files, strict=True)
    ]
    return _joined(chosen, made, settings)


def files_of(stage: Any, settings: RenderSettings, diagnostics: Diagnostics) -> dict[str, str]:
    """Return the files of all products by product path; the frame number is filled in if the settings name a frame.

    Diagnostics that renders of the products would report about names and outputs, and refusals, are added to `diagnostics`.
    """
    from .. import usd

    found = usd.products(stage, settings, diagnostics)
    made = zip(found, _distinct_paths(found, diagnostics), strict=True)
    files = {product.path: frame_name(file).numbered(settings.time_code) for product, file in made}
    for product in found:
        usd.outputs_of(product, settings, diagnostics)
    try:
        check_files([(file, path) for path, file in files.items()])
    except SettingsError as error:
        diagnostics.add("output-parameter", "", f"--all-products will refuse this: {error.message}.", "productName")
    return files


def renders_of(products: Iterable[Product]) -> list[tuple[RenderSettings, list[Product]]]:
    """Return the settings of each render, with the products that it makes."""
    found: dict[RenderSettings, list[Product]] = {}
    for product in products:
        found.setdefault(product.settings, []).append(product)
    return list(found.items())


@with_setting_names
def render_products(
    stage: str | os.PathLike[str] | object,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    asked: Sequence[str] | None = None,
    *,
    record: bool = False,
    progress: Progress | Literal[False] | None = None,
    **values: Unpack[SettingsValues],
) -> Iterator[tuple[Product, Image]]:
    """Render several products of one stage, given as a Usd.Stage or as a path, each with its own camera and overrides.

    >>> [product.path for product, image in primray.render_products("shot.usda", resolution=(32, 18), spp=2)]
    ['']

    `asked` names some of them by path or name. Products that differ in names and outputs alone share one render and come one
    after another. A file holds what its product orders; with `record` the picture and its standard errors, too. The rest is as
    for `render`.
    """
    settings = with_values(settings, values)
    opened = open_once(stage, settings)
    renders = renders_of(_at_frame(product) for product in products_of(opened, settings, asked))
    check_files([(product.file_name, product.path) for _, products in renders for product in products])
    images = rendered_frames(opened, [settings for settings, _ in renders], progress=progress)
    for (_, products), image in zip(renders, images, strict=True):
        for product in products:
            yield product, product.image_of(image, record=record)


def check_files(files: Iterable[tuple[str, str]]) -> None:
    """Raise SettingsError if two pictures would be written to one file, through any folders and links.

    Each file comes with the path of its product.
    """
    seen: dict[str, str] = {}
    for file, product in files:
        place = os.path.realpath(file).casefold()
        if place in seen:
            sentence = f"the products {seen[place]} and {product} would be written to one file, {place}: "
            raise SettingsError(sentence + "give them different productNames", where=file, code="product-output")
        seen[place] = product


def _at_frame(product: Product) -> Product:
    """Return the product with the frame's number in its file name."""
    name = frame_name(product.file_name)
    if product.settings.time_code is None and name.has_holder:
        raise SettingsError("the product's name has a frame number: set time_code", where=str(name), code="frames")
    return replace(product, file_name=name.numbered(product.settings.time_code))


def _joined(found: Sequence[ProductSettings], products: Sequence[Product], settings: RenderSettings) -> list[Product]:
    """Return the products, with shared settings where one render makes several.

    Those settings name all products whose files hold AOVs.
    """
    from .. import usd

    groups: list[tuple[object, list[int]]] = []
    for number, product in enumerate(found):
        key = usd.pixel_settings(product, settings)
        for other, members in groups:
            if other == key and usd.can_share_render([found[n] for n in (*members, number)], settings):
                members.append(number)
                break
        else:
            groups.append((key, [number]))
    made = list(products)
    for _, members in groups:
        with_parts = [products[n].path for n in members if products[n].has_parts]
        first = products[members[0]].settings
        if not with_parts:
            shared = replace(first, aovs=())
        elif len(with_parts) == 1:
            shared = replace(first, product=with_parts[0] or None)
        else:
            shared = replace(first, product=with_parts[0], joint_products=tuple(with_parts[1:]))
        for n in members:
            made[n] = replace(products[n], settings=shared)
    return made


def _shortened(name: str) -> str:
    return name if len(name) <= LONGEST_SHOWN else f"{name[:LONGEST_SHOWN]}..."


def _distinct_paths(products: Sequence[ProductSettings], diagnostics: Diagnostics) -> list[str]:
    """Return the products' files; those that differ in case only are numbered after the first."""
    taken: set[str] = set()
    files = []
    for product in products:
        for change in changes_of(product.name):
            message = f"productName = {_shortened(product.name)!r}: {change}."
            diagnostics.add("output-parameter", product.path, message, "productName")
        wanted = file = product_path(product.name, product.path.rpartition("/")[2] or "picture")
        path, number = PurePosixPath(wanted), 2
        while os.path.normpath(file).casefold() in taken:
            file, number = str(path.with_name(with_number(path.name, number))), number + 1
        if file != wanted:
            message = f"Another product is written to {wanted}, so this one is written to {file}."
            diagnostics.add("output-parameter", product.path, message, "productName")
        taken.add(os.path.normpath(file).casefold())
        files.append(file)
    return files


# Picture extensions that are not supported and become .exr. Any other suffix is part of the name ("shot.0001", "key.v2").
OTHER_PICTURES = frozenset(
    f".{name}"
    for name in (
        *("bmp", "dpx", "gif", "heic", "iff", "jp2", "j2k", "pfm", "pic", "ppm", "psd"),
        *("rat", "rgbe", "sgi", "tga", "tx", "webp"),
    )
)
# Device names reserved by Windows, whatever their extension.
RESERVED = frozenset(["con", "prn", "aux", "nul", *(f"{device}{n}" for device in ("com", "lpt") for n in "0123456789¹²³")])
_SCHEME = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]+):/+(?P<rest>.*)", re.DOTALL)
_DRIVE = re.compile(r"[A-Za-z]:")
LONGEST = 180  # bytes of the stem in UTF-8; file systems allow 255, less temporary suffixes and frame numbers


def product_path(name: str, default: str) -> str:
    """Return the path of a productName's file: safe folders and `safe_product_name`.

    A relative path is below the folder that the caller chooses. Windows drives and URL schemes (`place_left_out`) are dropped.
    """
    text = _folders_of(name)
    folder, slash, own = text.rpartition("/")
    parts = [_safe_folder(part) for part in folder.split("/") if part not in ("", ".")]
    root = "/" if slash and text.startswith("/") else ""
    return posixpath.normpath(root + "/".join([*parts, safe_product_name(own, default)]))


def changes_of(name: str) -> list[str]:
    """Return how `product_path` differs from a productName, in clauses; spelling such as \\ and <F4> does not count."""
    found = []
    if place := place_left_out(name):
        found.append(f"{place} is not supported and is left out; the rest is a relative path")
    *folders, own = _folders_of(name).split("/")
    plain = _last_part(own)
    stem, _ = _split(plain)
    suffix = PurePosixPath(plain).suffix
    if suffix.lower() in OTHER_PICTURES:
        found.append(f"{suffix} is not supported, and an EXR is written instead")
    parts = [part for part in folders if part not in ("", ".", "..")]
    if any(len(part.encode("utf-8", "replace")) > LONGEST for part in (*parts, stem)):
        found.append(f"names are cut to {LONGEST} bytes")
    kept = [_safe_folder(part) == _cut(_spelled(part)) for part in parts] + [
        plain == _spelled(own),
        _safe_stem(stem) == _cut(stem),
    ]
    if own.strip(".") and not all(kept):
        found.append("characters that file systems refuse or interpret are replaced or left out")
    return found


def place_left_out(name: str) -> str:
    """Return the Windows drive or URL scheme that `product_path` drops from a productName, or ""."""
    name = name.strip()
    if (scheme := _SCHEME.match(name)) is not None and len(scheme["scheme"]) > 1:
        return "" if scheme["scheme"].lower() == "file" else f"{scheme['scheme']}:"
    return name[:2] if _DRIVE.match(name) else ""


def _folders_of(name: str) -> str:
    """Return the name with / between folders; a path below a drive or scheme becomes relative."""
    text = name.strip().replace("\\", "/")
    left_out = place_left_out(name)
    if left_out:
        return text[len(left_out) :].lstrip("/")
    if (scheme := _SCHEME.match(text)) is not None:
        return f"/{scheme['rest']}"
    return text


def _safe_folder(part: str) -> str:
    if part == "..":
        return part
    cleaned = _cut(_last_part(part)).rstrip(" ")
    return re.sub(r"^~", "_", cleaned) or "_"


def safe_product_name(name: str, default: str) -> str:
    """Return a file name without folders for a productName, with an extension that can be written.

    `default` is the stem if nothing is left of the name; it is made safe as well.
    """
    for text in (name, default):
        stem, extension = _split(_last_part(text))
        stem = _safe_stem(stem)
        if stem:
            return stem + extension
    return "picture.exr"


def _last_part(text: str) -> str:
    """Return the last part of a Unix or Windows path, without control and reserved characters."""
    part = re.sub(r"^[A-Za-z]:", "", re.split(r"[/\\]", text)[-1])
    part = _spelled(part)
    return "".join("_" if unicodedata.category(c)[0] == "C" or c in '<>:"|?*' else c for c in part)


def _spelled(text: str) -> str:
    """Return the text in normalized spelling: composed characters, $F4 for <F4>."""
    composed = unicodedata.normalize("NFC", text.encode("utf-8", "replace").decode("utf-8"))
    return re.sub(r"<F(F|\d*)>", r"$F\1", composed)  # no reserved characters


def _cut(text: str) -> str:
    return text.encode()[:LONGEST].decode("utf-8", "ignore")


def _split(part: str) -> tuple[str, str]:
    suffix = PurePosixPath(part).suffix
    if suffix.lower() in EXTENSIONS:
        return part[: -len(suffix)], suffix
    if suffix.lower() in OTHER_PICTURES:
        return part[: -len(suffix)], ".exr"
    return part, ".exr"


def _safe_stem(stem: str) -> str:
    """Return a stem that is not a hidden file, a command option or a device; "" if nothing is left."""
    stem = stem.lstrip(" .-~").rstrip(". ")
    stem = _cut(stem).strip(". ")
    return f"_{stem}" if stem.split(".")[0].strip().lower() in RESERVED else stem
