"""Attributes of other renderers that are read here, where UsdGeom and UsdLux have no word for what they say."""

from __future__ import annotations

from dataclasses import dataclass

# Whether the camera sees a light: the first of these that is authored decides. Each is a number or a flag, 0 for lights
# that the camera does not see.
CAMERA_VISIBILITY = (
    "inputs:visibility:camera",  # hdEmbree of the UsdLux test suite
    "primvars:ri:attributes:visibility:camera",  # RenderMan; hdOSPRay reads it as well
    "karma:light:renderlightgeo",
    "primvars:arnold:camera",  # a weight
    "visibleInPrimaryRay",  # Omniverse RTX
)

# The group that a light is in: Karma's, RenderMan's (an input of its light's shader, or authored on the prim) and Arnold's.
LIGHT_GROUPS = ("karma:light:lpetag", "ri:light:lightGroup", "inputs:ri:light:lightGroup", "primvars:arnold:aov")

# What the camera sees of a shape, where a render pass says so: one of description.CameraSight.
CAMERA_SIGHT = "primray:camera"
# Of a prim that a render pass leaves out though it has members below.
LEFT_OUT = "primray:leftOut"
# Of a back plate's card: it has the material that it binds itself, whatever binds more strongly above it.
OWN_MATERIAL = "primray:ownMaterial"

ROLLING_SHUTTER = "omni:rtx:rollingShutter:"  # Omniverse RTX; adapters/cameras/rolling_shutter.py


@dataclass(frozen=True)
class Convention:
    """How one renderer's attributes say what an aperture looks like. UsdGeomCamera itself has none for it."""

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
# Words in the names of attributes that would change the lens, whoever's they are.
LENS_WORDS = ("aperture", "blade", "bokeh", "dof", "lens", "distortion")

# What RenderSettings and their products say of samples and depth, read by adapters/rendering/foreign_settings.py. Of names for
# one thing the first that is authored counts.
KARMA_SAMPLES = ("karma:global:pathtracedsamples", "karma:global:samplesperpixel")
RENDERMAN_SAMPLES = ("ri:hider:maxsamples",)
CYCLES_SAMPLES = ("cycles:samples", "cycles:session:samples")
CYCLES_TIME = "cycles:time_limit"
# Limits of single kinds of bounces: their sum is the longest path that a renderer with such limits follows.
KARMA, KARMA_BOUNCES = ("karma:object:", "karma:global:"), ("diffuselimit", "reflectlimit", "refractlimit")
ARNOLD = ("arnold:global:", "arnold:")
ARNOLD_BOUNCES = ("GI_diffuse_depth", "GI_specular_depth", "GI_transmission_depth")
ARNOLD_OPTIONS = ("AA_samples", "AA_samples_max", "enable_adaptive_sampling", "GI_total_depth", *ARNOLD_BOUNCES)
TOTAL_BOUNCES = ("ri:integrator:PxrPathTracer:maxIndirectBounces", "ri:trace:maxdepth", "cycles:integrator:max_bounce")
PATH_LENGTHS = ("ri:integrator:PxrPathTracer:maxPathLength",)
# Stopping by an estimate of the error, which each renderer measures in a way of its own: reported, not read.
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
