"""UsdRenderVars to AOVs: the schema leaves source names to renderers, so the names in use are mapped to AOVs.

They are collected from Hydra's HdAovTokens, the USD plug-ins of RenderMan and Arnold, Karma's standard render variables
(ray:hitP ...) and Omniverse.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ...aovs import (
    AOVS,
    CRYPTOMATTES,
    LABELS,
    LIGHT_PATH,
    LIGHTS,
    LONGEST_NAME,
    NAMED_LIGHT_PATHS,
    PRIMVAR,
    SEMANTIC,
    THINGS,
    USUAL_TAXONOMY,
    AovRequest,
    check_names,
    data_type_of,
    light_path_of,
    occlusion_distance,
    without_prefix,
)
from ...diagnostics import Diagnostics
from ...errors import SettingsError, did_you_mean
from ...lpe.automaton import check_expressions
from .render_product import RenderVariable

# Names of the picture itself (the beauty).
BEAUTY = frozenset({"Ci", "C", "C.*", "color", "rgb", "rgba", "RGB", "RGBA", "beauty", "Beauty", "LdrColor", "HdrColor"})
PICTURE = ("R", "G", "B", "A")
ALPHA = frozenset({"a", "A", "alpha", "Alpha"})
ERRORS = frozenset({"stderr", "standardError"})
COMMON: dict[str, tuple[str, ...]] = {
    "depth": (
        *("z", "Z", "Pz", "cameraDepth", "linearDepth", "__depth", "ray:hitPz", "distance_to_image_plane"),
        "DistanceToImagePlaneSD",
    ),
    "distance": ("ray:hitdist", "distance_to_camera", "DistanceToCameraSD"),
    "position": ("P", "Pworld", "__Pworld", "Pw", "worldPosition", "ray:hitP"),
    "camera_position": ("Peye", "Pcam", "Pc"),
    "normal": ("N", "Nn", "Nworld", "__Nworld", "normals", "Normal", "ray:hitN", "NormalSD"),
    "geometric_normal": ("Ng", "Ngn", "ray:hitNg"),
    "camera_normal": ("Neye", "Ncam"),
    "st": ("uv", "UV", "__st"),
    "albedo": ("Albedo",),
    "occlusion": ("ao", "AO", "ambientOcclusion", "AmbientOcclusion", "ambient_occlusion", "Occlusion", "occ"),
    "emission": ("Emission", "emissive"),
    "volume_depth": ("volume_Z", "volumeZ"),
    "guide_albedo": ("denoise_albedo",),
    "guide_normal": ("denoise_normal",),
    "motion_forward": ("motionFore",),
    # Omniverse's vectors are those to the frame before: left and up are above 0 where a point came from there.
    "motion_backward": ("motionBack", "motion_vectors", "TargetMotionSD"),
    "prim": ("primId", "id", "ID", "objectId", "objectid", "ray:objectid", "instance_id_segmentation", "primPaths"),
    "instance": ("instanceId", "instanceid"),
    "material": ("materialId", "materialid"),
    "samples": ("sampleCount", "samplecount", "ray:pixelsamples"),
}
CRYPTO = {  # as Arnold, RenderMan and Karma call them
    "crypto_object": ("CryptoObject", "cryptoObject"),
    "crypto_material": ("CryptoMaterial", "cryptoMaterial"),
    "crypto_asset": ("CryptoAsset", "cryptoAsset"),
}
NAMES = {name: source for source in AOVS for name in (source, *COMMON.get(source, ()))}
NAMES |= {name: source for source in CRYPTOMATTES for name in (source, *CRYPTO[source])}
# Omniverse's annotators of labels. Boxes are in the report, beside the numbers of the things that they are of.
OF_LABELS = {
    SEMANTIC: ("semantic_segmentation", "SemanticSegmentationSD"),
    THINGS: (
        *("instance_segmentation", "instance_segmentation_fast", "InstanceSegmentationSD"),
        *("bounding_box_2d_tight", "bounding_box_2d_tight_fast", "BoundingBox2DTightSD"),
        *("bounding_box_2d_loose", "bounding_box_2d_loose_fast", "BoundingBox2DLooseSD"),
        *("bounding_box_3d", "bounding_box_3d_fast", "bounding_box_3d_360", "BoundingBox3DSD"),
    ),
}
NAMES |= {name: source + USUAL_TAXONOMY for source, names in OF_LABELS.items() for name in (source[:-1], *names)}
OF_PATHS = {  # as Cycles and Karma call them
    "volume": ("combinedvolume",),
    "volume_direct": ("VolumeDir", "directvolume"),
    "volume_indirect": ("VolumeInd", "indirectvolume"),
}
NAMES |= {name: LIGHT_PATH + path for own, path in NAMED_LIGHT_PATHS.items() for name in (own, *OF_PATHS[own])}
NAMES[LIGHTS] = LIGHTS  # of each light apart; no other renderer has one output for all of them
# Light path expressions that select all light, the picture.
LPE_BEAUTY = frozenset({"C.*", "C.*[LO]", "C.*<[LO].>", "C[.]*[LO]", "C.*[<L.>O]", "C.*[<L.><O.>]"})


def aovs_of_variables(variables: Iterable[RenderVariable], diagnostics: Diagnostics) -> tuple[AovRequest, ...]:
    """Return the AOVs of a product in order, without those that are the picture; report variables that cannot be rendered."""
    found: dict[str, AovRequest] = {}
    for request, path in _requests(variables, diagnostics):
        if request.name in found:
            diagnostics.add(
                "render-var", path, f"Two variables of the product are named {request.name}: only the first is rendered."
            )
        else:
            found[request.name] = request
    return _possible(tuple(found.values()), diagnostics)


def _possible(requests: tuple[AovRequest, ...], diagnostics: Diagnostics) -> tuple[AovRequest, ...]:
    """Return the requests without the last light path expressions, which are reported, if one render cannot make all."""
    while True:
        paths = [request for request in requests if light_path_of(request.source) is not None]
        try:
            check_expressions([request.source.removeprefix(LIGHT_PATH) for request in paths])
        except SettingsError as error:
            diagnostics.add("render-var", "", f"{paths[-1].name} is not rendered: {error.message}.", "sourceName")
            requests = tuple(request for request in requests if request is not paths[-1])
        else:
            return requests


def _requests(variables: Iterable[RenderVariable], diagnostics: Diagnostics) -> Iterator[tuple[AovRequest, str]]:
    for var in variables:
        source = _source(var, diagnostics)
        if source is not None:
            data_type = var.data_type
            if data_type_of(data_type) is None:
                message = f"dataType = {data_type!r} is not a type for channels: the source's own type is used."
                diagnostics.add("render-var", var.path, message, "dataType")
                data_type = ""
            if source == LIGHTS and data_type not in ("", "color3f"):
                message = f"dataType = {data_type!r}: the light of each light is stored as color3f, for mixes that keep errors."
                diagnostics.add("render-var", var.path, message, "dataType")
                data_type = "color3f"
            _note_double(var, diagnostics)
            yield AovRequest(var.name, source, data_type, var.errors, var.prefix), var.path


def _note_double(var: RenderVariable, diagnostics: Diagnostics) -> None:
    if "double" in var.data_type or var.data_type.endswith("d"):
        message = f"dataType = {var.data_type!r}: EXR files have no doubles: floats are stored."
        diagnostics.add("output-parameter", var.path, message, "dataType")


def halves_of_picture(variables: Iterable[RenderVariable], diagnostics: Diagnostics) -> tuple[str, ...]:
    """Return the picture's channels to store as half; the first variable of a channel decides."""
    found: dict[str, str] = {}
    for var in variables:
        channels = _channels_in_picture(var)
        wanted = data_type_of(var.data_type)
        if not channels:
            continue
        _note_double(var, diagnostics)
        if wanted is None or wanted.stored == "uint":
            message = f"dataType = {var.data_type!r}: the picture's channels are float or half: floats are stored."
            diagnostics.add("render-var", var.path, message, "dataType")
            continue
        if var.prefix:
            message = f"channel_prefix = {var.prefix!r} is ignored: the picture's channels are R, G, B and A."
            diagnostics.add("output-parameter", var.path, message, "driver:parameters:aov:channel_prefix")
        for channel in channels if channels != PICTURE or wanted.components > 3 else channels[:3]:
            if found.setdefault(channel, wanted.stored) != wanted.stored:
                message = f"Another variable stores the picture's {channel} as {found[channel]}, which is used."
                diagnostics.add("render-var", var.path, message, "dataType")
    return tuple(channel for channel, stored in found.items() if stored == "half")


def picture_channels(variables: Iterable[RenderVariable]) -> tuple[str, ...]:
    """Return the picture's channels that a product orders, "stderr" for standard errors; without variables R, G, B and A."""
    ordered = list(variables)
    found = set[str]()
    for var in ordered:
        channels, wanted = _channels_in_picture(var), data_type_of(var.data_type)
        is_rgb = channels == PICTURE and wanted is not None and wanted.components <= 3 and not _names_alpha(var)
        found.update(channels[:3] if is_rgb else channels)
    return tuple(c for c in (*PICTURE, "stderr") if c in found) if ordered else PICTURE


def _names_alpha(var: RenderVariable) -> bool:
    return (var.source_name or var.name).lower() == "rgba"


def _channels_in_picture(var: RenderVariable) -> tuple[str, ...]:
    name = var.source_name or var.name
    if var.source_type == "primvar":
        return ()
    if var.source_type == "lpe" or name.lower().startswith(("lpe:", "color lpe:")):
        return PICTURE if without_prefix(name) in LPE_BEAUTY else ()
    return PICTURE if name in BEAUTY else ("A",) if name in ALPHA else ("stderr",) if name in ERRORS else ()


def _source(var: RenderVariable, diagnostics: Diagnostics) -> str | None:
    """Return the AOV's source; None if the picture has it or, with a diagnostic, if there is no such output."""
    name = var.source_name or var.name  # "an output of this name": without a sourceName, the variable's own name is the source
    if var.source_type == "primvar":
        return _primvar(name.removeprefix("primvars:"), var, diagnostics)
    if var.source_type == "lpe" or name.lower().startswith(("lpe:", "color lpe:")):
        return _light_path(without_prefix(name), var, diagnostics)
    if name in BEAUTY or name in ALPHA or name in ERRORS:
        return None
    if name in NAMES:
        return NAMES[name]
    if occlusion_distance(name) is not None:
        return name
    if name.startswith(("semantics:labels:", LABELS, SEMANTIC, THINGS)):
        return _labels(name.replace("semantics:labels:", LABELS, 1), var, diagnostics)
    if name.startswith(("primvars:", PRIMVAR)):
        return _primvar(name.removeprefix("primvars:").removeprefix(PRIMVAR), var, diagnostics)
    known = ", ".join((*AOVS, *NAMED_LIGHT_PATHS, LIGHTS, *CRYPTOMATTES))
    message = f"There is no output named {name}{_hint(name)}; there are {known} and primvars."
    diagnostics.add("render-var", var.path, message, "sourceName")
    return None


def _hint(name: str) -> str:
    if "crypto" in name.lower():  # other renderers have one Cryptomatte output, or spell it differently
        return f" (Cryptomattes are {', '.join(CRYPTOMATTES)})"
    hint = did_you_mean(name, (*NAMES, *BEAUTY, *ALPHA, *ERRORS))
    return f" ({hint})" if hint else ""


def _primvar(name: str, var: RenderVariable, diagnostics: Diagnostics) -> str | None:
    source = PRIMVAR + name
    try:
        check_names([source])
    except SettingsError:
        message = f"sourceName = {name[:LONGEST_NAME]!r} is not a name of a primvar."
        diagnostics.add("render-var", var.path, message, "sourceName")
        return None
    return source


def _light_path(expression: str, var: RenderVariable, diagnostics: Diagnostics) -> str | None:
    if expression in LPE_BEAUTY:
        return None
    try:
        check_expressions([expression])
    except SettingsError as error:
        diagnostics.add("render-var", var.path, f"The output is not rendered: {error.message}.", "sourceName")
        return None
    return LIGHT_PATH + expression


def _labels(source: str, var: RenderVariable, diagnostics: Diagnostics) -> str | None:
    try:
        check_names([source])
    except SettingsError:
        taxonomy = source.partition(":")[2]
        message = f"sourceName = {taxonomy[:LONGEST_NAME]!r} is not a name of a taxonomy."
        diagnostics.add("render-var", var.path, message, "sourceName")
        return None
    return source
