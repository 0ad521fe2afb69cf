"""The pictures that one command renders: frames of the stage, or of several of its products."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SettingsError
from ..render.frames import FrameName, check_names, frame_name
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..images.image import Image
    from ..render import OpenedStage
    from ..render.products import Product


@dataclass(frozen=True)
class Shot:
    """One picture and the files it is written to. `report` is the JSON file beside them."""

    settings: RenderSettings
    files: list[str]
    report: str | None = None
    products: Mapping[str, Product] = field(default_factory=dict)  # the product that each file is for, if any
    with_record: bool = False  # files of products include the picture and its standard errors, ordered or not
    reports: list[dict[str, Any]] | None = None  # reports of the frame's renders so far, if its products share a report file

    def report_file_of(self, report: dict[str, Any]) -> dict[str, Any]:
        """Return the content of the report file after this render; for products, the reports of the whole frame."""
        if self.reports is None:
            return report
        self.reports.append(report)
        return {"renders": self.reports}

    def image_in(self, file: str, image: Image) -> Image:
        """Return the image with the content of the file."""
        product = self.products.get(file)
        return image if product is None else product.image_of(image, record=self.with_record)


def moments(time_codes: list[float] | None) -> list[float | None]:
    """Return the requested frames, or the stage's default time."""
    return [*time_codes] if time_codes else [None]


def require_only_products(chosen_twice: bool, are_named: bool, checkpoint: str | None) -> None:
    """Raise SettingsError for flags that exclude products: both ways to choose them, file names, checkpoints."""
    faults = {
        "--all-products and --product both choose products; give one of them": chosen_twice,
        "-o names one file, but products have their own file names; --output-dir chooses their folder": are_named,
        "products have no checkpoints; --checkpoint and --resume are for a single picture, named by -o": checkpoint is not None,
    }
    for sentence, is_so in faults.items():
        if is_so:
            raise SettingsError(sentence, code="product-output")


def product_shots(
    scene: str,
    settings: RenderSettings,
    asked: Sequence[str] | None,
    folder: str | None,
    time_codes: list[float] | None,
    with_record: bool = False,
    report: str | None = None,
) -> tuple[OpenedStage, list[Shot]]:
    """Return the opened stage, and shots of the requested products (None: all), frame by frame, under their own names.

    Relative names are below `folder`. `report` is the file for the reports of a frame's renders.
    """
    from ..render import open_once
    from ..render.products import check_files, products_of, renders_of

    opened = open_once(scene, settings)
    products = products_of(opened, settings, asked)
    names = {product.path: _name_in_frames(product, time_codes) for product in products}
    if report is not None:
        check_names([frame_name(report)], time_codes)
    shots, written = [], []
    for time_code in moments(time_codes):
        report_file = None if report is None else frame_name(report).of(time_code)
        reports: list[dict[str, Any]] | None = None if report is None else []
        for own, made in renders_of(products):
            files = [str(Path(folder or "", names[product.path].numbered(time_code))) for product in made]
            written += [(file, product.path) for file, product in zip(files, made, strict=True)]
            by_file = dict(zip(files, made, strict=True))
            shots.append(
                Shot(
                    settings=replace(own, time_code=time_code),
                    files=files,
                    report=report_file,
                    products=by_file,
                    with_record=with_record,
                    reports=reports,
                )
            )
    check_files(written)
    return opened, shots


def _name_in_frames(product: Product, time_codes: list[float] | None) -> FrameName:
    name = frame_name(product.file_name)
    if time_codes is None and name.has_holder:  # the stage's author intended frames
        raise SettingsError("the product's name has a frame placeholder; pass --frames", where=str(name), code="frames")
    # A name without a frame placeholder gets one, which has room for fractions.
    check_names([name if name.has_holder else frame_name(f"{name}.$FF")], time_codes)
    return name
