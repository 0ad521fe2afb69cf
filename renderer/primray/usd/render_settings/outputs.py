"""Outputs of one render for a product, or for several products of one picture, and the contents of each file.

`output_facts` describes the RenderSettings, products, variables and passes of a stage.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any

from pxr import Usd

from ...aovs import CRYPTOMATTES, DEEP, AovRequest, data_type_of, kind_of, light_paths_of, primvar_of, requests_of
from ...description.picture_file import LOSSY, PLAIN, Contents, PictureFile, PictureView
from ...diagnostics import Diagnostics
from ...errors import SettingsError
from ...lpe.automaton import check_expressions
from ...settings import WHOLE, RenderSettings
from ...settings.stage_settings import StageSettings
from ..stage.messages import scene_errors
from ..stage.reads import targets, type_name
from ..stage.traversal import world_prims
from ..stage.values import When, when_of_few
from .render_pass import settings_of_pass
from .render_product import ProductSettings
from .render_settings import products
from .render_var import PICTURE, aovs_of_variables, halves_of_picture, picture_channels
from .stage_settings import read_stage_settings

STDERR = "stderr"
DEEP_REQUEST, DEEP_ALONE = AovRequest(DEEP, DEEP), Contents(is_deep=True)


def outputs_of(
    product: ProductSettings, settings: RenderSettings, diagnostics: Diagnostics
) -> tuple[tuple[AovRequest, ...], PictureFile]:
    """Return the AOVs to render beside the picture, and the product's file.

    If a product was requested by path, `PictureFile.products` has the files of all products of this render.
    """
    if settings.aovs is not None:
        aovs, file = requests_of(settings.aovs), product.file
        parts = tuple((request.name, request.name) for request in aovs)
        contents = Contents(requested_picture_channels(settings.aovs), parts)
        deep = {p.path for p in (product, *product.beside) if p.is_deep and settings.product is not None}
        files = [
            (p.path, replace(p.file, contents=DEEP_ALONE if p.path in deep else contents)) for p in (product, *product.beside)
        ]
        if deep:
            aovs = tuple(dict.fromkeys((*aovs, DEEP_REQUEST)))
    else:
        union = _RequestUnion()
        files = [(p.path, _product_file(p, union, diagnostics)) for p in (product, *product.beside)]
        aovs, file = tuple(union.requests.values()), replace(files[0][1], contents=None)
    for one in (product, *product.beside):
        own = dict(files)[one.path].contents
        _note_lossy(one, [request for request in aovs if own is None or request.name in dict(own.parts).values()], diagnostics)
    if settings.aov_errors:
        aovs = tuple(replace(request, errors=True) for request in aovs)
    return aovs, replace(file, products=tuple(files)) if settings.product is not None else file


def _note_lossy(product: ProductSettings, requests: Iterable[AovRequest], diagnostics: Diagnostics) -> None:
    exact = [request.name for request in requests if _is_stored_exactly(request)] if product.file.compression in LOSSY else []
    if exact:
        message = f"Its compression, {product.file.compression}, is lossy, so {', '.join(exact)} (ids or Cryptomatte) use zip."
        diagnostics.add("output-parameter", product.path, message)


def _is_stored_exactly(request: AovRequest) -> bool:
    """Return whether an output's numbers must be stored exactly: ids, counts, Cryptomattes."""
    stored, kind = data_type_of(request.data_type) if request.data_type else None, kind_of(request.source)
    is_whole = stored.stored == "uint" if stored is not None else kind is not None and kind.unsigned
    return is_whole or request.source in CRYPTOMATTES


def ordered_picture_channels(product: ProductSettings, settings: RenderSettings) -> tuple[str, ...]:
    """Return the channels of the picture that a product's file holds."""
    if settings.aovs is not None:
        return requested_picture_channels(settings.aovs)
    return picture_channels(product.variables) or (() if aovs_of_variables(product.variables, Diagnostics()) else PICTURE)


def pixel_settings(product: ProductSettings, settings: RenderSettings) -> ProductSettings:
    """Return the product's settings that affect pixels and are not overridden by the user's settings.

    They are equal for products that one render can make.
    """
    return replace(
        product,
        path="",
        name="",
        type="",
        variables=(),
        file=PLAIN,
        camera=product.camera if settings.camera is None else None,
        resolution=product.resolution if settings.resolution is None else None,
        data_window=product.data_window if settings.region is None else WHOLE,
        asked=StageSettings(product.asked.applied_to(settings)[1]).without_places(),
    )


def can_share_render(products: Sequence[ProductSettings], settings: RenderSettings) -> bool:
    """Return whether one film can hold all light path expressions that the products order."""
    if settings.aovs is not None:
        return True
    requests = [request for product in products for request in aovs_of_variables(product.variables, Diagnostics())]
    try:
        check_expressions(light_paths_of(requests))
    except SettingsError:
        return len(products) == 1
    return True


def requested_picture_channels(names: Iterable[str]) -> tuple[str, ...]:
    """Return the picture's channels if the user names the outputs: all, and standard errors if they are named."""
    return (*PICTURE, STDERR) if STDERR in names else PICTURE


def _product_file(product: ProductSettings, union: _RequestUnion, diagnostics: Diagnostics) -> PictureFile:
    if product.is_deep:
        union.add(DEEP_REQUEST)
        _note_not_deep(product, diagnostics)
        return replace(product.file, half=(), contents=DEEP_ALONE)
    requests = aovs_of_variables(product.variables, diagnostics)
    halves = halves_of_picture(product.variables, diagnostics) if product.variables else ()
    parts = tuple((request.name, union.add(request)) for request in requests)
    picture = picture_channels(product.variables)
    contents = Contents(picture if picture or parts else PICTURE, parts)
    return replace(product.file, half=(*product.file.half, *halves), contents=contents)


def _note_not_deep(product: ProductSettings, diagnostics: Diagnostics) -> None:
    """Report variables and options of a deep picture that its file does not have."""
    for request in aovs_of_variables(product.variables, diagnostics):
        if request.source != "depth":
            message = f"A deepRaster has R, G, B, A, Z and ZBack: {request.name} is left out. Order it of a raster product."
            diagnostics.add("output-parameter", product.path, message, "orderedVars")
    if product.file.compression not in ("", "zips"):
        message = f"A deepRaster is compressed by zips, not {product.file.compression}."
        diagnostics.add("output-parameter", product.path, message)


class _RequestUnion:
    """AOV requests of several products, each once and under a unique name."""

    def __init__(self) -> None:
        self.requests: dict[str, AovRequest] = {}
        self._names: dict[AovRequest, str] = {}

    def add(self, request: AovRequest) -> str:
        """Add a request; return the output's name in the image."""
        if request not in self._names:
            name, number = request.name, 2
            while name in self.requests:
                name, number = f"{request.name}#{number}", number + 1
            self._names[request] = name
            self.requests[name] = request if name == request.name else _renamed(request, name)
        return self._names[request]


def _renamed(request: AovRequest, name: str) -> AovRequest:
    """Return the request under another name, with its channel names unchanged."""
    prefix = request.prefix
    if prefix is None:
        prefix = request.name if request.data_type else primvar_of(request.source) or request.name
    return replace(request, name=name, prefix=prefix)


MOST_LISTED = 500  # entries of each list


@scene_errors()
def output_facts(stage: Usd.Stage, settings: RenderSettings) -> dict[str, Any]:
    """Return the stage's RenderSettings and passes in order, and the products of the settings that a render uses."""
    prims = list(world_prims(stage))
    found = products(stage, settings, Diagnostics())
    followed = found[0].settings_path
    when = when_of_few(settings.time_code)
    return {
        "render_settings": [_settings_facts(prim, followed, when) for prim in prims if type_name(prim) == "RenderSettings"][
            :MOST_LISTED
        ],
        "products": [_product_facts(product, settings) for product in found if product.path][:MOST_LISTED],
        "render_passes": [_pass_facts(stage, prim) for prim in prims if type_name(prim) == "RenderPass"][:MOST_LISTED],
    }


def _settings_facts(prim: Usd.Prim, followed: str, when: When) -> dict[str, Any]:
    path = str(prim.GetPath())
    asked, view = read_stage_settings(prim, None, when, Diagnostics())
    products = [str(p) for p in targets(prim, "products")]
    return {"path": path, "followed": path == followed, "products": products, **_requested_facts(asked, view)}


def _requested_facts(asked: StageSettings, view: PictureView) -> dict[str, Any]:
    """Return the render settings and the view that a prim asks for, whether or not flags override them."""
    return {"asks": asked.as_json(), "view": None if view == PictureView() else asdict(view)}


def _product_facts(product: ProductSettings, settings: RenderSettings) -> dict[str, Any]:
    return {
        "path": product.path,
        "product_name": product.name,
        "camera": product.camera,
        "resolution": list(product.resolution) if product.resolution else None,
        "picture": list(ordered_picture_channels(product, settings)),
        **_requested_facts(product.asked, product.file.view),
        "variables": [
            {
                "path": v.path,
                "name": v.name,
                "source": v.source_name or v.name,
                "source_type": v.source_type,
                "data_type": v.data_type,
            }
            for v in product.variables
        ],
    }


def _pass_facts(stage: Usd.Stage, prim: Usd.Prim) -> dict[str, Any]:
    path = str(prim.GetPath())
    try:
        source = settings_of_pass(stage, path)
    except SettingsError:
        source = None
    return {"path": path, "render_settings": source}
