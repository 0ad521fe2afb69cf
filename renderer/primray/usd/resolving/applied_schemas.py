"""Which applied schemas are read, which mean nothing to a picture, and which would change one and are ignored.

USD's own are told apart by name, those of other programs by how their names begin. A schema in no table is unknown, also where
USD knows it (a plug-in's, or of a newer USD): nobody has looked at what it means to a picture. Names are without those of
instances.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from pxr import Usd

from ..querying.guarded import schemas_applied

_READ = """CollectionAPI GeomModelAPI LightAPI MaterialBindingAPI MotionAPI NodeDefAPI ShadowAPI ShapingAPI SkelBindingAPI
    MaterialXConfigAPI MeshLightAPI VolumeLightAPI ColorSpaceAPI ColorSpaceDefinitionAPI VisibilityAPI
    LODRootAPI LODOverrideAPI BackPlateAPI"""
# Of the proposal "physical-lighting", which USD 26.11 does not know; they are for lights.
PHOTOMETRIC = frozenset(f"{m}metric{kind}LightAPI" for m in ("Photo", "Radio") for kind in ("Area", "Dome", "Distant"))
ILLUMINANT = "PhysicalLightIlluminantAPI"
PHYSICAL = PHOTOMETRIC | {ILLUMINANT}
# Ours, and those of other programs: adapters/cameras/ has what they say.
_READ_OF_OTHERS = """OmniLensDistortionFthetaAPI OmniLensDistortionKannalaBrandtK3API OmniLensDistortionLutAPI
    OmniLensDistortionOpenCvFisheyeAPI OmniLensDistortionOpenCvPinholeAPI OmniLensDistortionRadTanThinPrismAPI
    OmniRtxRollingShutterAPI PrimrayLensAPI PrimrayRenderProductAPI PrimrayRenderSettingsAPI PrimrayRenderVarAPI"""
# Physics, user interfaces, statements about the asset; LightListAPI only speeds up finding lights. The parts of a particle
# field say nothing where the field itself is not rendered.
_WITHOUT_EFFECT = """AccessibilityAPI AssetPreviewsAPI AuthorshipAPI ClaimsAPI HydraPrimAPI HydraRenderPassAPI LightListAPI
    ListAPI NodeGraphNodeAPI SceneGraphPrimAPI SemanticsLabelsAPI
    PhysicsArticulationRootAPI PhysicsCollisionAPI PhysicsDriveAPI PhysicsFilteredPairsAPI PhysicsLimitAPI PhysicsMassAPI
    PhysicsMaterialAPI PhysicsMeshCollisionAPI PhysicsRigidBodyAPI
    ParticleFieldKernelBaseAPI ParticleFieldKernelConstantSurfletAPI ParticleFieldKernelGaussianEllipsoidAPI
    ParticleFieldKernelGaussianSurfletAPI ParticleFieldOpacityAttributeAPI ParticleFieldOrientationAttributeAPI
    ParticleFieldPositionAttributeAPI ParticleFieldPositionBaseAPI ParticleFieldRadianceBaseAPI ParticleFieldScaleAttributeAPI
    ParticleFieldSphericalHarmonicsAttributeAPI"""
UNDERSTOOD = frozenset(f"{_READ} {_READ_OF_OTHERS} {_WITHOUT_EFFECT}".split()) | PHYSICAL

# What is done instead.
IGNORED = {
    "CoordSysAPI": "Coordinate systems are not read.",
    "HydraGenerativeProceduralAPI": "What its procedural would make is missing.",
    "OmniLensDistortionOmniDirectionalStereoAPI": "Its camera is rendered as one eye, without it.",
    "PhysicalCameraResponsivityAPI": "The camera has the standard observer's colours, not a sensor's own.",
    "PhysicalColorFilterArrayAPI": "The picture is no sensor's raw one.",
    "RiMaterialAPI": "RenderMan's outputs are read only where they lead to a UsdPreviewSurface.",
    "RiSplineAPI": "RenderMan's splines are not read.",
    "StatementsAPI": "RenderMan's attributes are not read.",
}

_SIMULATED = "They say how things are simulated; what is drawn stands as it is authored."
_RENDERER = "They are settings of another renderer."
_LABELS = "They are labels."
_HOUDINI = "They speak to Houdini's viewport and editors."
# First letters of schemas that leave the picture as it is, and what they are there for.
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
# Those among them, or other ones, without which something is missing from the picture; the longest beginning decides.
_OTHERS_CHANGING = {
    "HoudiniApex": "What its rig would deform stands as it is authored.",
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
    """The row of a schema, by its name without that of an instance; None where it is unknown."""
    rows = [Foreign(begins, True, text) for begins, text in _OTHERS_CHANGING.items()]
    rows += [Foreign(begins, False, text) for begins, text in _OTHERS_WITHOUT_EFFECT.items()]
    fitting = [row for row in rows if _begins(name, row.family)]
    return max(fitting, key=lambda row: len(row.family), default=None)


def _begins(name: str, family: str) -> bool:
    """Where a new word follows: Mjc is no part of Mjcat."""
    rest = name.removeprefix(family)
    return rest != name and not rest[:1].islower()


def is_without_effect(name: str) -> bool:
    row = foreign_schema(name)
    return row is not None and not row.changes_picture


def applied_schemas(prim: Usd.Prim) -> list[str]:
    """Those that are authored on the prim, with instance names; what its type brings is not among them."""
    return [str(schema) for schema in schemas_applied(prim)]
