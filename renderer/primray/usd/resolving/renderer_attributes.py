"""Attributes of other renderers that are read here, where UsdGeom and UsdLux have no equivalent."""

from __future__ import annotations

from dataclasses import dataclass

# Camera visibility of a light: the first of these that is authored decides. Each is a number or a flag, 0 for lights
# hidden from the camera.
CAMERA_VISIBILITY = (
    "inputs:visibility:camera",  # hdEmbree of the UsdLux test suite
    "primvars:ri:attributes:visibility:camera",  # RenderMan; hdOSPRay reads it as well
    "karma:light:renderlightgeo",
    "primvars:arnold:camera",  # a weight
    "visibleInPrimaryRay",  # Omniverse RTX
)

# Light group of a light: Karma's, RenderMan's (an input of its light's shader, or authored on the prim) and Arnold's.
LIGHT_GROUPS = ("karma:light:lpetag", "ri:light:lightGroup", "inputs:ri:light:lightGroup", "primvars:arnold:aov")

# Camera visibility of a shape, set by a render pass: one of description.CameraSight.
CAMERA_SIGHT = "primray:camera"
# Mark on a prim that a render pass excludes although it has members below.
LEFT_OUT = "primray:leftOut"
# Mark on a back plate's card: its own material binding counts, whatever stronger binding is above it.
OWN_MATERIAL = "primray:ownMaterial"

ROLLING_SHUTTER = "omni:rtx:rollingShutter:"  # Omniverse RTX; adapters/cameras/rolling_shutter.py


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

# Samples and depth in RenderSettings and their products, read by adapters/rendering/foreign_settings.py. Among names for
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
