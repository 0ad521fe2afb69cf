"""The seam between USD and the core: a scene as frozen data and numpy arrays. Knows neither USD nor Embree.

Matrices are 4x4 float64 in column-vector convention, named right to left (`world_from_object`). Lengths are scene
units. Colours are linear in the rendering colour space (`rendering_space`). The package `usd` makes a
SceneDescription; `core` uploads it.
"""

from ..aovs import AovRequest
from ..arrays import Doubles, Floats, Ints
from ..camera import Camera, Projection
from .fog import Fog
from .geometry import (
    Curves,
    Direction,
    DisplacedMesh,
    Interpolation,
    Mesh,
    NurbsPatch,
    Primvar,
    Ribbons,
    Shape,
    Sphere,
    SubdivisionMesh,
    TrimCurve,
)
from .lighting import IesProfile, Light, LightType, Linked, Portal, Shadow, Shaping
from .motion import CameraMotion, Exposure, MatrixMotion, MotionSteps, PointMotion
from .placement import Instances, MatrixInstances, MovingInstances, Placement, PointInstances
from .scene import Frame, PixelWindow, Placed, Prototype, SceneDescription
from .shading import (
    CameraVisibility,
    Hair,
    HomogeneousVolume,
    Input,
    NodeOutput,
    OpenPbr,
    Operand,
    Pattern,
    PatternInput,
    PatternNode,
    PrimvarInput,
    Surface,
    TextureFile,
    TextureInput,
    Wrap,
    volume_boundary,
)
from .volumes import VelocityBlur, VolumeEmission, VolumeMedium

__all__ = [
    "AovRequest",
    "Camera",
    "CameraMotion",
    "CameraVisibility",
    "Curves",
    "Direction",
    "DisplacedMesh",
    "Doubles",
    "Exposure",
    "Floats",
    "Fog",
    "Frame",
    "Hair",
    "HomogeneousVolume",
    "IesProfile",
    "Input",
    "Instances",
    "Interpolation",
    "Ints",
    "Light",
    "LightType",
    "Linked",
    "MatrixInstances",
    "MatrixMotion",
    "Mesh",
    "MotionSteps",
    "MovingInstances",
    "NodeOutput",
    "NurbsPatch",
    "OpenPbr",
    "Operand",
    "Pattern",
    "PatternInput",
    "PatternNode",
    "PixelWindow",
    "Placed",
    "Placement",
    "PointInstances",
    "PointMotion",
    "Portal",
    "Primvar",
    "PrimvarInput",
    "Projection",
    "Prototype",
    "Ribbons",
    "SceneDescription",
    "Shadow",
    "Shape",
    "Shaping",
    "Sphere",
    "SubdivisionMesh",
    "Surface",
    "TextureFile",
    "TextureInput",
    "TrimCurve",
    "VelocityBlur",
    "VolumeEmission",
    "VolumeMedium",
    "Wrap",
    "volume_boundary",
]
