"""Back plates of cameras (UsdGeom BackPlateAPI): a card that fills the frustum at focusDistance + focalLength.

The card is written to a copy of the stage as a mesh below the camera, with an unlit material that shows the image. The plate
of the rendered camera fills its conformed window, plates of other cameras (visibility `all`) fill their own apertures. Decoded
colours are graded: (in * slope + offset) ^ power. With a depth image the card is a relief with a vertex per texel at its depth:
(texel - minOffset) * normalizingFactor + cameraSpaceOffset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from ...arrays import Doubles, Floats, Ints
from ...camera import Camera, Projection
from ...color.color_space import ColorSpace
from ...color.ocio import space_named
from ...description import Frame, TextureFile
from ...diagnostics import Diagnostics
from ...errors import AssetError
from ...textures.image_layout import read_header
from ...textures.texture import load_texture
from ..scene.inheritance import transforms
from ..scene.schemas import OWN_MATERIAL
from ..stage.edits import check_reach, editable, end_instance
from ..stage.open import scratch_copy
from ..stage.reads import color_space_name, read_asset, schemas_applied
from ..stage.values import StandIns, When, is_hidden, read
from .camera import usd_camera

if TYPE_CHECKING:
    import OpenImageIO as oiio


SCHEMA = "BackPlateAPI"
UNITS_PER_TENTH = 0.1  # UsdGeomCamera: focalLength is in tenths of a scene unit
# MaterialX type and channel of the opacity, by its image's number of channels. Two channels are read as grey and alpha.
_ALPHA = {1: ("float", None), 2: ("color4", 3), 4: ("color4", 3)}


@dataclass(frozen=True)
class Plate:
    """One back plate: an instance of the multiple-apply schema on a camera."""

    camera: Usd.Prim
    name: str

    def value(self, what: str, when: When, default: Any) -> Any:
        found = read(self.camera, f"backPlate:{self.name}:{what}", when)
        return default if found is None else found

    def file(self, what: str, when: When) -> str:
        found = self.value(what, when, None)
        return str(found.resolvedPath or found.path) if isinstance(found, Sdf.AssetPath) else ""

    def color_space(self, what: str) -> str:
        """Return the colour space authored on the attribute of an image, "" if none is."""
        attribute = self.camera.GetAttribute(f"backPlate:{self.name}:{what}")
        return color_space_name(attribute) if attribute else ""


@dataclass(frozen=True)
class RenderedCamera:
    """The rendered camera, conformed to its frame."""

    prim: Usd.Prim
    camera: Camera
    frame: Frame


def find_back_plates(cameras: Sequence[Usd.Prim]) -> list[Plate]:
    """Return the back plates of all cameras of the stage."""
    return [
        Plate(camera, schema.partition(":")[2])
        for camera in cameras
        for schema in map(str, schemas_applied(camera))
        if schema.startswith(f"{SCHEMA}:")
    ]


def with_back_plates(
    stage: Usd.Stage, plates: Sequence[Plate], looks: RenderedCamera | None, when: When, diagnostics: Diagnostics
) -> Usd.Stage:
    """Return a copy of the stage with the plates as meshes; `looks` is the rendered camera if it is one of the stage."""
    made = scratch_copy(stage)
    own = None if looks is None else looks.prim.GetPath()
    with Usd.EditContext(made, made.GetSessionLayer()):
        for plate in plates:
            path = plate.camera.GetPath()
            visibility = plate.value("plateVisibility", when, "solo")
            if visibility == "mute" or (visibility != "all" and path != own):
                continue
            if is_hidden(plate.camera, when):
                diagnostics.add("api-schema", str(path), f"{SCHEMA}: the plate is not rendered, as its camera is invisible.")
                continue
            if (camera := editable(made, path)).IsInstance():  # the card is a child
                end_instance(camera)
            through = looks if path == own else None
            card = _card(plate, None if through is None else through.camera, when)
            _report_unreadable_images(plate, when, diagnostics)
            _write(made, plate, card, _shape(plate, card, when, diagnostics), through, when)
    check_reach(made)
    return made


def _card(plate: Plate, conformed: Camera | None, when: When) -> Card:
    camera = usd_camera(plate.camera, when, StandIns(when), transforms(when))
    away = float(camera.focusDistance) + UNITS_PER_TENTH * float(camera.focalLength)
    if conformed is None:
        window = camera.frustum.GetWindow()
        sides = (*(window.GetMin()), *(window.GetMax()))
        left, bottom, right, top = (float(side) for side in sides)
        flat = camera.projection == Gf.Camera.Orthographic
    else:
        left, right, bottom, top = conformed.window
        flat = conformed.projection is Projection.ORTHOGRAPHIC
    scale = 1.0 if flat else away
    return Card(left=left * scale, right=right * scale, bottom=bottom * scale, top=top * scale, away=away, flat=flat)


def _shape(plate: Plate, card: Card, when: When, diagnostics: Diagnostics) -> Relief:
    file = plate.file("depth:image", when)
    if not file:
        return flat_card(card)
    least, factor, offset = (
        float(plate.value(f"depth:{name}", when, default))
        for name, default in (("minOffset", 0.0), ("normalizingFactor", 1.0), ("cameraSpaceOffset", 0.0))
    )
    try:
        return relief(card, read_depths(file, _depth_space(plate, diagnostics), least, factor, offset))
    except AssetError as error:
        message = f"The plate {plate.name} is rendered flat: its depth image cannot be read ({error.message})."
        diagnostics.add("asset-missing", str(plate.camera.GetPath()), message, f"backPlate:{plate.name}:depth:image")
        return flat_card(card)


def _depth_space(plate: Plate, diagnostics: Diagnostics) -> str | ColorSpace:
    """Return the depth image's encoding: stored numbers, unless the attribute has a colour space."""
    name = plate.color_space("depth:image")
    space = space_named(name) if name else None
    if name and space is None:
        message = f"Unknown colour space {name!r}: depths are used as stored."
        diagnostics.add("color-space", str(plate.camera.GetPath()), message, f"backPlate:{plate.name}:depth:image")
    return "raw" if space is None or (isinstance(space, ColorSpace) and space.is_data) else space


def _report_unreadable_images(plate: Plate, when: When, diagnostics: Diagnostics) -> None:
    """Report images of the plate that cannot be opened or have no opacity; damaged pixels are reported as for any texture."""
    for what, without in (("image", "black"), ("alpha:image", "opaque")):
        file = plate.file(what, when)
        count = _channels(file) if file else 0
        if not file or (count in _ALPHA if what != "image" else count):
            continue
        why = f"has {count} channels, none of which is opacity" if count else "cannot be read"
        message = f"The plate {plate.name} is {without}: its {what} {file} {why}."
        diagnostics.add("asset-missing", str(plate.camera.GetPath()), message, f"backPlate:{plate.name}:{what}")


def _write(stage: Usd.Stage, plate: Plate, card: Card, shape: Relief, through: RenderedCamera | None, when: When) -> None:
    path = plate.camera.GetPath().AppendChild(f"__backPlate_{plate.name.replace(':', '_')}")
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(shape.points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.quads), 4))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.quads.ravel()))
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    st.Set(Vt.Vec2fArray.FromNumpy(shape.st))
    mesh.AddTranslateOp().Set(Gf.Vec3d(*card.center))
    mesh.AddTranslateOp(opSuffix="tweak").Set(Gf.Vec3d(plate.value("translate:tweak", when, Gf.Vec3f(0))))
    mesh.AddRotateXYZOp(opSuffix="tweak").Set(plate.value("rotateXYZ:tweak", when, Gf.Vec3f(0)))
    scale = plate.value("scale:tweak", when, Gf.Vec2f(1))
    mesh.AddScaleOp(opSuffix="tweak").Set(Gf.Vec3f(scale[0], scale[1], 1))
    material = UsdShade.Material.Define(stage, path.AppendChild("image"))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    mesh.GetPrim().CreateAttribute(OWN_MATERIAL, Sdf.ValueTypeNames.Bool).Set(True)
    mesh.CreatePurposeAttr(UsdGeom.Tokens.default_)  # rigs are often guides
    _bind_image(_Nodes(stage, material.GetPath()), material, plate, through, when)


def _bind_image(nodes: _Nodes, material: UsdShade.Material, plate: Plate, through: RenderedCamera | None, when: When) -> None:
    unlit = nodes.node("unlit", "ND_surface_unlit")
    material.CreateSurfaceOutput("mtlx").ConnectToSource(unlit.CreateOutput("out", Sdf.ValueTypeNames.Token))
    image = plate.file("image", when)
    color: UsdShade.Output | Gf.Vec3f = Gf.Vec3f(0)
    if image and _channels(image):
        color = nodes.image("color", "color3", image, plate.color_space("image"), whole=_is_as_fine(image, through))
    slope, offset, power = (
        plate.value(f"luma:{name}", when, Gf.Vec3f(k)) for name, k in (("slope", 1), ("offset", 0), ("power", 1))
    )
    for name, value, neutral in (("multiply", slope, 1), ("add", offset, 0), ("max", Gf.Vec3f(0), None), ("power", power, 1)):
        graded = power != Gf.Vec3f(1) if name == "max" else value != Gf.Vec3f(neutral)
        if graded:
            color = nodes.apply(name, "color3", color, value)
    nodes.set(unlit, "emission_color", "color3", color)
    alpha = plate.file("alpha:image", when)
    kind, number = _ALPHA.get(_channels(alpha) if alpha else 0, (None, None))
    if kind is not None:
        space = plate.color_space("alpha:image") or "raw"
        found = nodes.image("opacity", kind, alpha, space, whole=_is_as_fine(alpha, through))
        nodes.set(unlit, "opacity", "float", found if number is None else nodes.extract(kind, found, number))


def _is_as_fine(path: str, through: RenderedCamera | None) -> bool:
    """Return whether an image is at least as wide as the render: then a pixel is the mean of the texels in it alone."""
    header = _header(path)
    return header is not None and through is not None and header.width >= through.frame.resolution[0]


def _channels(path: str) -> int:
    """Return the number of channels, 0 if the image cannot be opened."""
    header = _header(path)
    return 0 if header is None else int(header.nchannels)


def _header(path: str) -> oiio.ImageSpec | None:
    try:
        return read_header(path, read_asset)
    except AssetError:
        return None


_TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "vector2": Sdf.ValueTypeNames.Float2,
    "color3": Sdf.ValueTypeNames.Color3f,
    "color4": Sdf.ValueTypeNames.Color4f,
}


class _Nodes:
    """Writer of a material's MaterialX nodes."""

    def __init__(self, stage: Usd.Stage, path: Sdf.Path) -> None:
        self._stage, self._path = stage, path

    def node(self, name: str, kind: str) -> UsdShade.Shader:
        made = UsdShade.Shader.Define(self._stage, self._path.AppendChild(name))
        made.CreateIdAttr(kind)
        return made

    def set(self, node: UsdShade.Shader, name: str, kind: str, value: object) -> None:
        made = node.CreateInput(name, _TYPES[kind])
        if isinstance(value, UsdShade.Output):
            made.ConnectToSource(value)
        else:
            made.Set(value)

    def image(self, name: str, kind: str, file: str, space: str, *, whole: bool = False) -> UsdShade.Output:
        """Return an image node's output. `space` is the file's colour space, "" for what USD and the file say."""
        place = self.node(f"{name}_st", "ND_geompropvalue_vector2")
        place.CreateInput("geomprop", Sdf.ValueTypeNames.String).Set("st")
        made = self.node(name, f"ND_image_{kind}")
        found = made.CreateInput("file", Sdf.ValueTypeNames.Asset)
        found.Set(Sdf.AssetPath(file))
        if space:
            found.GetAttr().SetColorSpace(space)
        self.set(made, "texcoord", "vector2", place.CreateOutput("out", Sdf.ValueTypeNames.Float2))
        if whole:
            made.CreateInput("filtertype", Sdf.ValueTypeNames.String).Set("closest")
        for axis in "uv":
            made.CreateInput(f"{axis}addressmode", Sdf.ValueTypeNames.String).Set("clamp")
        return made.CreateOutput("out", _TYPES[kind])

    def apply(self, name: str, kind: str, first: object, second: object) -> UsdShade.Output:
        made = self.node(name, f"ND_{name}_{kind}")
        self.set(made, "in1", kind, first)
        self.set(made, "in2", kind, second)
        return made.CreateOutput("out", _TYPES[kind])

    def extract(self, kind: str, first: UsdShade.Output, number: int) -> UsdShade.Output:
        made = self.node("alpha", f"ND_extract_{kind}")
        self.set(made, "in", kind, first)
        made.CreateInput("index", Sdf.ValueTypeNames.Int).Set(number)
        return made.CreateOutput("out", _TYPES["float"])


MOST_TEXELS = 1 << 21  # larger images are subsampled: every second, third ... texel


@dataclass(frozen=True, kw_only=True)
class Card:
    """A plate without depth: its sides at the distance `away`, in scene units; `flat` if rays are parallel."""

    left: float
    right: float
    bottom: float
    top: float
    away: float
    flat: bool

    @property
    def center(self) -> tuple[float, float, float]:
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2, -self.away


@dataclass(frozen=True, eq=False)
class Relief:
    """Mesh of a plate."""

    points: Floats  # (N, 3) from the card's centre
    quads: Ints  # (F, 4)
    st: Floats  # (N, 2)


def flat_card(card: Card) -> Relief:
    x, y = (card.right - card.left) / 2, (card.top - card.bottom) / 2
    points = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], np.float32)
    st = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    return Relief(points, np.array([[0, 1, 2, 3]], np.int32), st)


def read_depths(path: str, space: str | ColorSpace, least: float, factor: float, offset: float) -> Doubles:
    """Return depths (H, W), the lowest row first; `space` is the texels' encoding. AssetError if the image cannot be read."""
    texels = load_texture(TextureFile(path, space, is_color=False), read_asset).channels(0, 1)[::-1, :, 0]
    step = int(np.ceil(np.sqrt(texels.size / MOST_TEXELS)))
    return (texels[::step, ::step].astype(np.float64) - least) * factor + offset


def relief(card: Card, depths: Doubles) -> Relief:
    """Return a mesh with a vertex per texel and along the edges; it has holes where depth is not positive."""
    deep = np.pad(depths, 1, mode="edge")
    t, s = (np.concatenate([[0.0], (np.arange(n) + 0.5) / n, [1.0]]) for n in depths.shape)
    s, t = np.broadcast_arrays(s[None, :], t[:, None])
    x, y = card.left + (card.right - card.left) * s, card.bottom + (card.top - card.bottom) * t
    scale = np.ones_like(deep) if card.flat else deep / card.away
    points = np.stack([x * scale, y * scale, -deep], axis=2) - card.center
    good = np.isfinite(deep) & (deep > 0)
    number = np.arange(deep.size).reshape(deep.shape)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=2).reshape(-1, 4)
    quads = quads[good.ravel()[quads].all(axis=1)]
    points = np.where(good[..., None], points, 0.0)
    st = np.stack([s, t], axis=2).reshape(-1, 2)
    return Relief(points.reshape(-1, 3).astype(np.float32), quads.astype(np.int32), st.astype(np.float32))
