"""Which applied schemas are read, which mean nothing to a picture, and which would change one and are ignored.

A schema in neither table is unknown, also where USD knows it (a plug-in's, or of a newer USD): nobody has looked at what it
means to a picture. Names are without instance names.
"""

from __future__ import annotations

from pxr import Usd

from ..querying.guarded import schemas_applied

_READ = """CollectionAPI GeomModelAPI LightAPI MaterialBindingAPI MotionAPI NodeDefAPI ShadowAPI ShapingAPI SkelBindingAPI
    MeshLightAPI VolumeLightAPI ColorSpaceAPI ColorSpaceDefinitionAPI VisibilityAPI"""
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
UNDERSTOOD = frozenset(_READ.split()) | frozenset(_WITHOUT_EFFECT.split())

# What is done instead.
IGNORED = {
    "BackPlateAPI": "Back plates are not rendered.",
    "CoordSysAPI": "Coordinate systems are not read.",
    "HydraGenerativeProceduralAPI": "What its procedural would make is missing.",
    "LODOverrideAPI": "Level-of-detail overrides have no effect.",
    "LODRootAPI": "Every level of detail is rendered.",
    "RiMaterialAPI": "RenderMan's outputs are read only where they lead to a UsdPreviewSurface.",
    "RiSplineAPI": "RenderMan's splines are not read.",
    "StatementsAPI": "RenderMan's attributes are not read.",
}


def applied_schemas(prim: Usd.Prim) -> list[str]:
    """Those that are authored on the prim, with instance names; what its type brings is not among them."""
    return [str(schema) for schema in schemas_applied(prim)]
