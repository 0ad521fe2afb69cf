"""Tables of applied schemas and of other renderers' attributes: which are read, which are harmless, which are ignored.

USD's own schemas are listed by name, those of other programs by prefix. A schema in no table is unknown, even if USD knows it
(from a plug-in or a newer USD): its effect on a picture has not been assessed. Names are without those of instances. Other
renderers' attributes are read where UsdGeom and UsdLux have no equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from pxr import Usd

from ..stage.reads import schemas_applied

_READ = """CollectionAPI GeomModelAPI LightAPI MaterialBindingAPI MotionAPI NodeDefAPI ShadowAPI ShapingAPI SkelBindingAPI
    MaterialXConfigAPI MeshLightAPI VolumeLightAPI ColorSpaceAPI ColorSpaceDefinitionAPI VisibilityAPI
    LODRootAPI LODOverrideAPI BackPlateAPI"""
# Schemas for lights from the proposal "physical-lighting", which USD 26.11 does not know.
PHOTOMETRIC = frozenset(f"{m}metric{kind}LightAPI" for m in ("Photo", "Radio") for kind in ("Area", "Dome", "Distant"))
ILLUMINANT = "PhysicalLightIlluminantAPI"
PHYSICAL = PHOTOMETRIC | {ILLUMINANT}
# Primray's schemas, and those of other programs that adapters/cameras/ reads.
_READ_OF_OTHERS = """OmniLensDistortionFthetaAPI OmniLensDistortionKannalaBrandtK3API OmniLensDistortionLutAPI
    OmniLensDistortionOpenCvFisheyeAPI OmniLensDistortionOpenCvPinholeAPI OmniLensDistortionRadTanThinPrismAPI
    OmniRtxRollingShutterAPI PrimrayFogAPI PrimrayLensAPI PrimrayLidarAPI PrimrayLightMeterAPI
    PrimrayRenderProductAPI PrimrayRenderSettingsAPI PrimrayRenderVarAPI PrimrayVolumeAPI"""
# Physics, user interfaces, statements about the asset; LightListAPI only speeds up finding lights. The parts of a particle
# field are irrelevant because the field itself is not rendered.
_WITHOUT_EFFECT = """AccessibilityAPI AssetPreviewsAPI AuthorshipAPI ClaimsAPI HydraPrimAPI HydraRenderPassAPI LightListAPI
    ListAPI NodeGraphNodeAPI SceneGraphPrimAPI SemanticsLabelsAPI
    PhysicsArticulationRootAPI PhysicsCollisionAPI PhysicsDriveAPI PhysicsFilteredPairsAPI PhysicsLimitAPI PhysicsMassAPI
    PhysicsMaterialAPI PhysicsMeshCollisionAPI PhysicsRigidBodyAPI
    ParticleFieldKernelBaseAPI ParticleFieldKernelConstantSurfletAPI ParticleFieldKernelGaussianEllipsoidAPI
    ParticleFieldKernelGaussianSurfletAPI ParticleFieldOpacityAttributeAPI ParticleFieldOrientationAttributeAPI
    ParticleFieldPositionAttributeAPI ParticleFieldPositionBaseAPI ParticleFieldRadianceBaseAPI ParticleFieldScaleAttributeAPI
    ParticleFieldSphericalHarmonicsAttributeAPI"""
UNDERSTOOD = frozenset(f"{_READ} {_READ_OF_OTHERS} {_WITHOUT_EFFECT}".split()) | PHYSICAL

# Text for each ignored schema of USD's or another known program's: what is done instead.
IGNORED = {
    "CoordSysAPI": "Coordinate systems are not read.",
    "HydraGenerativeProceduralAPI": "What its procedural would make is missing.",
    "OmniLensDistortionOmniDirectionalStereoAPI": "Its camera is rendered monoscopically, without it.",
    "PhysicalCameraResponsivityAPI": "The camera has the standard observer's response, not a sensor's.",
    "PhysicalColorFilterArrayAPI": "The picture is not a raw sensor image.",
    "RiMaterialAPI": "RenderMan's outputs are read only where they lead to a UsdPreviewSurface.",
    "RiSplineAPI": "RenderMan's splines are not read.",
    "StatementsAPI": "RenderMan's attributes are not read.",
}

_SIMULATED = "They configure simulations; prims are drawn as authored."
_RENDERER = "They are settings of another renderer."
_LABELS = "They are labels."
_HOUDINI = "They are for Houdini's viewport and editors."
_SENSORS = "They are of sensors; `primray lidar` reads those of lidars."
# Prefixes of schemas that do not affect the picture, with their purpose.
_OTHERS_WITHOUT_EFFECT = {
    "Physics": _SIMULATED,
    "Physx": _SIMULATED,
    "PhysX": _SIMULATED,
    "Newton": _SIMULATED,
    "Mjc": _SIMULATED,
    "Isaac": _SIMULATED,
    "Preliminary_Physics": _SIMULATED,
    "Semantics": _LABELS,
    "OmniSensor": _SENSORS,
    "Houdini": _HOUDINI,
    "Arnold": _RENDERER,
    "Cycles": _RENDERER,
    "Karma": _RENDERER,
    "Moonray": _RENDERER,
    "Typhoon": _RENDERER,
}
# Prefixes of schemas without which the picture lacks something; the longest matching prefix of both tables decides.
_OTHERS_CHANGING = {
    "HoudiniApex": "Its rig is not evaluated; prims are drawn as authored.",
    "HoudiniLightBarnDoor": "Barn doors do not shade the light.",
    "HoudiniProcedural": "What its procedural would make is missing.",
    "PhysxDiffuseParticles": "The particles that a simulation would make are missing.",
    "PhysxParticleIsosurface": "The surface that a simulation would make of its particles is missing.",
}


@dataclass(frozen=True)
class Foreign:
    family: str  # how the names begin
    changes_picture: bool
    meaning: str


@cache
def foreign_schema(name: str) -> Foreign | None:
    """Return the row of a schema, given its name without that of an instance; None where it is unknown."""
    rows = [Foreign(begins, True, text) for begins, text in _OTHERS_CHANGING.items()]
    rows += [Foreign(begins, False, text) for begins, text in _OTHERS_WITHOUT_EFFECT.items()]
    fitting = [row for row in rows if _begins(name, row.family)]
    return max(fitting, key=lambda row: len(row.family), default=None)


def _begins(name: str, family: str) -> bool:
    """Return whether a name begins with the family as a whole word: Mjc is not a prefix of Mjcat."""
    rest = name.removeprefix(family)
    return rest != name and not rest[:1].islower()


def is_without_effect(name: str) -> bool:
    row = foreign_schema(name)
    return row is not None and not row.changes_picture


def applied_schemas(prim: Usd.Prim) -> list[str]:
    """Return the schemas authored on the prim, with instance names; those built into its type are not included."""
    return [str(schema) for schema in schemas_applied(prim)]


# Camera visibility of a light: the first of these that is authored decides. Each is a number or a flag, 0 for lights
# hidden from the camera.
CAMERA_VISIBILITY = (
    "inputs:visibility:camera",  # hdEmbree of the UsdLux test suite
    "primvars:ri:attributes:visibility:camera",  # RenderMan; hdOSPRay reads it as well
    "karma:light:renderlightgeo",
    "primvars:arnold:camera",  # a weight
    "visibleInPrimaryRay",  # Omniverse RTX
)

# Arnold's factor of the velocities that blur a volume.
VELOCITY_SCALES = ("primvars:arnold:velocity_scale", "arnold:velocity_scale")

# Light group of a light: Karma's, RenderMan's (an input of its light's shader, or authored on the prim) and Arnold's.
LIGHT_GROUPS = ("karma:light:lpetag", "ri:light:lightGroup", "inputs:ri:light:lightGroup", "primvars:arnold:aov")

# Camera visibility of a shape, set by a render pass: one of description.CameraVisibility.
SHAPE_VISIBILITY = "primray:camera"
# Mark on a prim that a render pass excludes although it has members below.
LEFT_OUT = "primray:leftOut"
# Mark on a back plate's card: its own material binding counts, whatever stronger binding is above it.
OWN_MATERIAL = "primray:ownMaterial"

ROLLING_SHUTTER = "omni:rtx:rollingShutter:"  # Omniverse RTX; camera/shutter.py


@dataclass(frozen=True)
class Convention:
    """Attribute names by which one renderer describes the shape of an aperture. UsdGeomCamera itself has none for it."""

    blades: str
    rotation_deg: str
    roundness: str  # 0: straight sides, 1: a circle


# Arnold: arnold-usd's read_camera.cpp hands "primvars:arnold:NAME" to the camera node; its manual has the meanings. RenderMan:
# hdPrman's camera.cpp reads "ri:NAME" and the older "ri:camera:NAME"; the meanings are PxrCamera's.
def _arnold(prefix: str) -> Convention:
    return Convention(
        f"{prefix}aperture_blades",
        f"{prefix}aperture_rotation",
        f"{prefix}aperture_blade_curvature",
    )


CONVENTIONS = (
    _arnold("primvars:arnold:"),
    _arnold("arnold:"),
    Convention("ri:apertureNSides", "ri:apertureAngle", "ri:apertureRoundness"),
    Convention("ri:camera:aperturensides", "ri:camera:apertureangle", "ri:camera:apertureroundness"),
)
# Words in names of attributes that would change the lens, of any renderer.
LENS_WORDS = ("aperture", "blade", "bokeh", "dof", "lens", "distortion")

# Samples and depth in RenderSettings and their products, read by render_settings/stage_settings.py. Among names for
# one thing the first that is authored counts.
KARMA_SAMPLES = ("karma:global:pathtracedsamples", "karma:global:samplesperpixel")
RENDERMAN_SAMPLES = ("ri:hider:maxsamples",)
CYCLES_SAMPLES = ("cycles:samples", "cycles:session:samples")
CYCLES_TIME = "cycles:time_limit"
# Limits per kind of bounce: their sum is the longest path that a renderer with such limits traces.
KARMA, KARMA_BOUNCES = ("karma:object:", "karma:global:"), ("diffuselimit", "reflectlimit", "refractlimit")
ARNOLD = ("arnold:global:", "arnold:")
ARNOLD_BOUNCES = ("GI_diffuse_depth", "GI_specular_depth", "GI_transmission_depth")
ARNOLD_OPTIONS = ("AA_samples", "AA_samples_max", "enable_adaptive_sampling", "GI_total_depth", *ARNOLD_BOUNCES)
TOTAL_BOUNCES = ("ri:integrator:PxrPathTracer:maxIndirectBounces", "ri:trace:maxdepth", "cycles:integrator:max_bounce")
PATH_LENGTHS = ("ri:integrator:PxrPathTracer:maxPathLength",)
# Thresholds of adaptive sampling, which each renderer measures differently: reported, not read.
ERROR_THRESHOLDS = (
    "ri:Ri:PixelVariance",
    "karma:global:convergencethreshold",
    "arnold:global:AA_adaptive_threshold",
    "arnold:AA_adaptive_threshold",
    "cycles:integrator:adaptive_threshold",
)
INTEGRATORS = ("ri:integrator", "outputs:ri:integrator")  # the prim that has a RenderMan integrator's settings
SETTINGS_OF_OTHERS = frozenset(
    {
        *INTEGRATORS,
        *KARMA_SAMPLES,
        *RENDERMAN_SAMPLES,
        *CYCLES_SAMPLES,
        CYCLES_TIME,
        *TOTAL_BOUNCES,
        *PATH_LENGTHS,
        "inputs:ri:maxIndirectBounces",
        "inputs:ri:maxPathLength",
        *ERROR_THRESHOLDS,
        *(f"{prefix}{name}" for prefix in KARMA for name in KARMA_BOUNCES),
        *(f"{prefix}{name}" for prefix in ARNOLD for name in ARNOLD_OPTIONS),
    }
)
