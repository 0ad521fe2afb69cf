"""The products of a stage's RenderSettings as renders: which there are, what each is called, and all of them from one stage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Literal, Unpack

from ..errors import SettingsError
from ..images.product_name import safe_product_name
from ..settings import RenderSettings, SettingsValues, with_values
from .prepare import OpenedStage, open_once
from .render import rendered_frames
from .settings_by_name import naming_settings

if TYPE_CHECKING:
    import os

    from ..images.image import Image
    from ..sampling.sampling import Progress
    from ..usd import ProductSettings


@dataclass(frozen=True)
class Product:
    """A picture that a stage's RenderSettings ask for. `file_name` has no folder, and no other product of the stage has it.

    >>> for product, image in primray.render_products("shot.usda", resolution=(32, 18), spp=2):
    ...     print(product.file_name, image.resolution)
    picture.exr (32, 18)
    """

    path: str  # of the RenderProduct; "": the settings have none, and this is the default one
    name: str  # productName as authored
    file_name: str
    settings: RenderSettings


def products_of(opened: OpenedStage, settings: RenderSettings, asked: Sequence[str] | None = None) -> list[Product]:
    """Those named by path or, if only one has it, by name (None: all), in the order of the stage's settings.

    SettingsError where one that is asked for does not exist.
    """
    from .. import usd

    found = usd.products(opened.stage, settings)
    chosen = [product for product in found if product.path in _paths(asked, found)] if asked is not None else list(found)
    names = _distinct_names(chosen)
    return [
        Product(p.path, p.name, name, replace(settings, product=p.path or None)) for p, name in zip(chosen, names, strict=True)
    ]


@naming_settings
def render_products(
    stage: str | os.PathLike[str] | object,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    asked: Sequence[str] | None = None,
    *,
    progress: Progress | Literal[False] | None = None,
    **values: Unpack[SettingsValues],
) -> Iterator[tuple[Product, Image]]:
    """Render several products of one stage, given as a Usd.Stage or as a path, each with its own camera and overrides.

    >>> [product.path for product, image in primray.render_products("shot.usda", resolution=(32, 18), spp=2)]
    ['']

    `asked` names some of them by path or name; the rest is as for `render`.
    """
    settings = with_values(settings, values)
    opened = open_once(stage, settings)
    products = products_of(opened, settings, asked)
    images = rendered_frames(opened, [product.settings for product in products], progress=progress)
    yield from zip(products, images, strict=True)


def _paths(asked: Iterable[str], found: Sequence[ProductSettings]) -> set[str]:
    paths = set()
    for text in asked:
        matching = [p.path for p in found if p.path == text] or [p.path for p in found if p.path.rpartition("/")[2] == text]
        if len(matching) != 1 or not text:
            listed = ", ".join(p.path for p in found if p.path) or "none"
            problem = f"Several products are called {text}" if len(matching) > 1 else f"There is no product {text}"
            raise SettingsError(
                f"{problem}; the products of the render settings: {listed}.", where=text, code="unknown-product"
            )
        paths.add(matching[0])
    return paths


def _distinct_names(products: Sequence[ProductSettings]) -> list[str]:
    """Safe file names; of those that are alike but for case, all after the first are told apart by a number."""
    taken: set[str] = set()
    names = []
    for product in products:
        name = safe_product_name(product.name, product.path.rpartition("/")[2] or "picture")
        stem, suffix = PurePosixPath(name).stem, PurePosixPath(name).suffix
        number = 2
        while name.casefold() in taken:
            name, number = f"{stem}_{number}{suffix}", number + 1
        taken.add(name.casefold())
        names.append(name)
    return names
