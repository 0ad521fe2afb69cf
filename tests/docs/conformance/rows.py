"""The rows of docs/conformance.md: every property of the schemas that a picture could depend on, as usd-core ships them.

A row is named "Class.property", both as the schema's own file spells them; of a multiple-apply schema, the property has
no prefix there ("CollectionAPI.includes" is collection:NAME:includes on a prim). What the schemas' texts define without
declaring a property for it (relationships made by name, metadata) is listed here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pxr
from pxr import Sdf, Usd

PLUGINS = Path(pxr.__file__).parent / "pluginfo"
LIBRARIES = {
    "UsdGeom": "usdGeom",
    "UsdLux": "usdLux",
    "UsdRender": "usdRender",
    "UsdShade": "usdShade",
    "UsdVol": "usdVol",
    "Usd": "usd",
}
NODES = "UsdShade's preview nodes"

# Of the library "usd", which is about composition; the rest of it is what USD itself does before anyone asks for a value.
CORE_CLASSES = frozenset({"CollectionAPI", "ColorSpaceAPI", "ColorSpaceDefinitionAPI", "ClipsAPI"})

# Of the library "usdVol"; its particle fields are not rendered.
VOLUME_CLASSES = frozenset({"Volume", "VolumeFieldAsset", "OpenVDBAsset", "Field3DAsset"})

# Defined by the text of a class alone: names with NAME in them stand for all of their kind.
UNDECLARED = {
    "Xformable": (
        "xformOp:translate",
        "xformOp:scale",
        "xformOp:rotate",
        "xformOp:orient",
        "xformOp:transform",
        "!resetXformStack!",
        "!invert!",
    ),
    "PrimvarsAPI": ("primvars:NAME", "primvars:NAME:indices", "interpolation", "elementSize", "unauthoredValuesIndex"),
    "PointInstancer": ("inactiveIds",),
    "GeomSubset": ("subsetFamily:NAME:familyType",),
    "MaterialBindingAPI": ("material:binding", "material:binding:collection", "bindMaterialAs"),
    "NodeGraph": ("inputs:NAME", "outputs:NAME"),
    "Shader": ("inputs:NAME", "outputs:NAME"),
    "NodeDefAPI": ("info:sourceAsset", "info:sourceCode"),
    "ConnectableAPI": ("connections",),
    "ClipsAPI": ("clips", "clipSets"),
    "LightAPI": ("collection:lightLink", "collection:shadowLink"),
    "LightFilter": ("collection:filterLink",),
    "Volume": ("field:NAME",),
    "RenderPass": (
        "collection:renderVisibility",
        "collection:cameraVisibility",
        "collection:prune",
        "collection:matte",
    ),
}

# Schemas that USD does not have: of the proposal "physical-lighting" (OpenUSD-proposals, as of July 2026), under a heading of
# its own.
PROPOSAL = "physical-lighting (proposed)"
PROPOSED = {
    "PhysicalLightIlluminantAPI": ("physical:illuminant", "physical:customIlluminant"),
    "PhotometricAreaLightAPI": ("photometric:power", "photometric:illuminance", "photometric:illuminance:distance"),
    "RadiometricAreaLightAPI": ("radiometric:power", "radiometric:irradiance", "radiometric:irradiance:distance"),
    "PhotometricDomeLightAPI": ("photometric:illuminance",),
    "RadiometricDomeLightAPI": ("radiometric:irradiance",),
    "PhotometricDistantLightAPI": ("photometric:illuminance",),
    "RadiometricDistantLightAPI": ("radiometric:irradiance",),
    "PhysicalCameraResponsivityAPI": tuple(f"physical:responsivity:{channel}" for channel in "rgb"),
    "PhysicalColorFilterArrayAPI": tuple(f"physical:colorFilterArray:{name}" for name in ("pattern", "wavelengths", "filters")),
}


CHOSEN = {"Usd": CORE_CLASSES, "UsdVol": VOLUME_CLASSES}


@dataclass(frozen=True)
class Row:
    library: str
    schema: str
    member: str  # the property

    @property
    def name(self) -> str:
        return f"{self.schema}.{self.member}"


def rows() -> dict[str, Row]:
    """By name, in the order of the schemas' files."""
    return {row.name: row for row in [*_of_schemas(), *_of_nodes(), *_of_proposals()]}


def _of_proposals() -> Iterator[Row]:
    for schema, names in PROPOSED.items():
        for name in names:
            yield Row(PROPOSAL, schema, name)


def _of_schemas() -> Iterator[Row]:
    for library, folder in LIBRARIES.items():
        layer = Sdf.Layer.FindOrOpen(str(PLUGINS / folder / "resources" / folder / "schema.usda"))
        for prim in layer.rootPrims:
            if prim.name in CHOSEN.get(library, (prim.name,)):
                for name in (*(spec.name for spec in prim.properties), *UNDECLARED.get(prim.name, ())):
                    yield Row(library, prim.name, name)


def _of_nodes() -> Iterator[Row]:
    """Composed, since the primvar readers inherit their name's input."""
    stage = Usd.Stage.Open(str(PLUGINS / "usdShaders" / "resources" / "shaders" / "shaderDefs.usda"))
    for prim in stage.GetPseudoRoot().GetChildren():  # without abstract ones
        for name in prim.GetPropertyNames():
            if name.startswith(("inputs:", "outputs:")):
                yield Row(NODES, prim.GetName(), name)
