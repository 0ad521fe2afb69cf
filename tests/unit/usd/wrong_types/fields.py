"""A stage with something of all that is read, and the same with one of its fields of another type each: metadata of the stage,
of prims and of properties, values, targets, composition arcs.

Where several fields have one value, the crate holds it once: then they change together.
"""

from __future__ import annotations

from collections.abc import Iterator

from .crates import Crate, crate_of, words

# Each value is another one, so that it can be found in the crate.
STAGE_METADATA = {
    "metersPerUnit": ("0.25", 0.25),
    "kilogramsPerUnit": ("0.75", 0.75),
    "upAxis": ('"Z"', b"Z"),
    "startTimeCode": ("3", 3.0),
    "endTimeCode": ("5", 5.0),
    "timeCodesPerSecond": ("25", 25.0),
    "framesPerSecond": ("30", 30.0),
    "framePrecision": ("11", 11),
    "defaultPrim": ('"world"', b"world"),
    "renderSettingsPrimPath": ('"/settings"', b"/settings"),
    "colorConfiguration": ("@colors@", b"colors"),
    "colorManagementSystem": ('"ocio"', b"ocio"),
    "customLayerData": ('{\n string camera = "front"\n }', None),
    "expressionVariables": ('{\n string SHOT = "one"\n }', None),
}
SCENE = """
def Xform "world" (
    kind = "component"
    prepend apiSchemas = ["MaterialBindingAPI", "ColorSpaceAPI", "GeomModelAPI", "CollectionAPI:cast"]
    assetInfo = {
        asset identifier = @a.usda@
    }
    customData = {
        int a = 1
    }
    prepend variantSets = ["look"]
    variants = {
        string look = "red"
    }
)
{
    double3 xformOp:translate = (1, 2, 3)
    double xformOp:rotateX:lean.timeSamples = {
        1: 10,
        2: 20,
    }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX:lean"]
    token visibility = "inherited"
    uniform token purpose = "default"
    uniform token colorSpace:name = "lin_ap1_scene"
    rel collection:cast:includes = </world/mesh>
    uniform token collection:cast:expansionRule = "expandPrims"
    rel material:binding:collection:cast = [</world.collection:cast>, </world/gold>]
    color3f[] primvars:displayColor = [(0.5, 0.25, 0.125)] (
        interpolation = "constant"
        elementSize = 1
        colorSpace = "srgb_rec709_scene"
    )

    def Mesh "mesh" (
        prepend apiSchemas = ["MaterialBindingAPI", "SkelBindingAPI"]
    )
    {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "none"
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = "vertex"
        )
        float primvars:weight = 0.375 (
            interpolation = "constant"
        )
        rel material:binding = </world/gold> (
            bindMaterialAs = "strongerThanDescendants"
        )

        def GeomSubset "part" (
            prepend apiSchemas = ["MaterialBindingAPI"]
        )
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </world/gold>
        }
    }

    def Material "gold"
    {
        token outputs:surface.connect = </world/gold/surface.outputs:surface>

        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </world/gold/image.outputs:rgb>
            float inputs:roughness.connect = </world/gold/reader.outputs:result>
            token outputs:surface
        }

        def Shader "image"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @none.<UDIM>.png@ (
                colorSpace = "srgb_texture"
            )
            token inputs:wrapS = "repeat"
            float4 inputs:fallback = (1, 0, 0, 1)
            float3 outputs:rgb
        }

        def Shader "reader"
        {
            uniform token info:id = "UsdPrimvarReader_float"
            string inputs:varname = "weight"
            float outputs:result
        }
    }

    def PointInstancer "instancer" (
        inactiveIds = [1]
    )
    {
        int[] protoIndices = [0, 0]
        int64[] ids = [1, 2]
        point3f[] positions = [(0, 0, 0), (4, 5, 6)]
        rel prototypes = </world/instancer/ball>

        def Sphere "ball"
        {
            double radius = 0.0625
        }
    }

    def Xform "native" (
        instanceable = true
        references = </world/mesh>
        inherits = </shape>
    )
    {
    }

    variantSet "look" = {
        "red" {
            def Cube "cube"
            {
                double size = 9
            }
        }
    }
}

class "shape"
{
}

def SphereLight "light" (
    prepend apiSchemas = ["ShapingAPI", "CollectionAPI:lightLink"]
)
{
    float inputs:intensity = 17
    rel collection:lightLink:includes = </world>
    bool collection:lightLink:includeRoot = 0
    rel light:filters = </world>
    asset inputs:shaping:ies:file = @lamp.ies@
}

def DomeLight "dome"
{
    asset inputs:texture:file = @sky.exr@
    rel portals = </portal>
}

def Camera "camera"
{
    float focalLength = 35
    float2 clippingRange = (0.1, 100)
    double shutter:close = 0.5
    token projection = "perspective"
}

def SkelRoot "root" (
    customData = {
        int b = 2
    }
)
{
    def Skeleton "skeleton" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token[] joints = ["a"]
        uniform matrix4d[] bindTransforms = [( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )]
        uniform matrix4d[] restTransforms = [( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )]
        rel skel:animationSource = </root/skeleton/animation>

        def SkelAnimation "animation"
        {
            uniform token[] joints = ["a"]
            float3[] translations.timeSamples = {
                1: [(0, 0, 1)],
                2: [(0, 0, 2)],
            }
            quatf[] rotations = [(1, 0, 0, 0)]
            half3[] scales = [(1, 1, 1)]
        }
    }

    def Mesh "skin" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
        rel skel:skeleton = </root/skeleton>
        int[] primvars:skel:jointIndices = [0, 0, 0] (
            elementSize = 1
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1] (
            elementSize = 1
            interpolation = "vertex"
        )
        uniform token subdivisionScheme = "none"
        normal3f[] primvars:normals = [(0, 0, 1), (0, 1, 0)] (
            interpolation = "vertex"
        )
        int[] primvars:normals:indices = [0, 1, 1]
    }

    def Mesh "flat" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 2, 0)]
        uniform token subdivisionScheme = "none"
        normal3f[] normals = [(1, 0, 0)] (
            interpolation = "uniform"
        )
        rel skel:skeleton = </root/skeleton>
        int[] primvars:skel:jointIndices = [0, 0, 0] (
            elementSize = 1
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1] (
            elementSize = 1
            interpolation = "vertex"
        )
    }
}

def Xform "cast" (
    prepend apiSchemas = ["SkelBindingAPI"]
)
{
    matrix4d primvars:skel:geomBindTransform = ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 1, 1) )

    def "one" (
        instanceable = true
        references = </root>
    )
    {
    }

    def "other" (
        instanceable = true
        references = </root>
    )
    {
    }
}

def RenderSettings "settings"
{
    uniform int2 resolution = (64, 32)
    rel products = </settings/product>
    rel camera = </camera>
    uniform token[] includedPurposes = ["default", "render"]

    def RenderProduct "product"
    {
        token productName = "picture.exr"
        rel orderedVars = </settings/product/color>

        def RenderVar "color"
        {
            uniform string sourceName = "Ci"
            uniform token dataType = "color3f"
        }
    }
}
"""


def base() -> Crate:
    metadata = "\n".join(f" {name} = {text}" for name, (text, _) in STAGE_METADATA.items())
    return crate_of(f'#usda 1.0\n(\n "of all kinds"\n{metadata}\n)\n{SCENE}')


def of_stage(crate: Crate) -> Iterator[tuple[str, str, Crate]]:
    """Each piece of the stage's metadata with each type, by their names."""
    values = crate.values
    for name in STAGE_METADATA:
        at = _place(crate, name)
        for kind, word in words().items():
            yield name, kind, crate.with_values([word if i == at else v for i, v in enumerate(values)])


def of_everything(crate: Crate) -> Iterator[tuple[str, str, Crate]]:
    """Each field of the layer with each type, the fields by their numbers."""
    values = crate.values
    for at in range(len(values)):
        for kind, word in words().items():
            yield str(at), kind, crate.with_values([word if i == at else v for i, v in enumerate(values)])


def _place(crate: Crate, name: str) -> int:
    return crate.fields.index(name.encode())
