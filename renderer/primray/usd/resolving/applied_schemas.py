"""Tables of applied schemas: those that are read, those that do not affect a picture, and those that would and are ignored.

USD's own are listed by name, those of other programs by prefix. A schema in no table is unknown, even if USD knows it (from a
plug-in or a newer USD): its effect on a picture has not been assessed. Names are without those of instances.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from pxr import Usd

from ..querying.guarded import schemas_applied

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
    OmniRtxRollingShutterAPI PrimrayLensAPI PrimrayRenderProductAPI PrimrayRenderSettingsAPI PrimrayRenderVarAPI"""
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
