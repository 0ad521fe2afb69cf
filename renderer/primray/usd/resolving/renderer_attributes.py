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
