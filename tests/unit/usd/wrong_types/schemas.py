"""Stages in which every attribute of a schema is of a wrong type, each on a prim of its own and all on one.

Schemas are those that USD itself knows, so that those of a newer one are taken along. What a prim needs for its attributes to
be read at all is written beside it.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Gf, Sdf, Tf, Usd, Vt

LIBRARIES = ("UsdGeom", "UsdLux", "UsdShade", "UsdSkel", "UsdRender", "UsdVol", "UsdMedia", "UsdLod")
TYPES: dict[str, object] = {
    "string": "wrong",
    "token": "wrong",
    "asset": Sdf.AssetPath("wrong.png"),
    "bool": True,
    "uchar": 3,
    "int": 7,
    "int64": 7,
    "half": 0.5,
    "float": 0.5,
    "double": 0.5,
    "timecode": Sdf.TimeCode(1),
    "float2": Gf.Vec2f(1, 2),
    "int3": Gf.Vec3i(1, 2, 3),
    "double3": Gf.Vec3d(1, 2, 3),
    "color4f": Gf.Vec4f(1, 2, 3, 4),
    "quath": Gf.Quath(1),
    "matrix4d": Gf.Matrix4d(1),
    "pathExpression": Sdf.PathExpression("//"),
    "opaque": None,
    "group": None,
    "int[]": Vt.IntArray([1, 2]),
    "float[]": Vt.FloatArray([0.5]),
    "token[]": Vt.TokenArray(["a", "b"]),
    "string[]": Vt.StringArray(["a"]),
    "asset[]": Sdf.AssetPathArray([Sdf.AssetPath("x")]),
    "double3[]": Vt.Vec3dArray([Gf.Vec3d(1)]),
    "quatf[]": Vt.QuatfArray([Gf.Quatf(1)]),
    "matrix4d[]": Vt.Matrix4dArray([Gf.Matrix4d(1)]),
    "relationship": None,
}
_FACES = """int[] faceVertexCounts = [3]
int[] faceVertexIndices = [0, 1, 2]
point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
"""
_BASES = {
    "Mesh": _FACES,
    "Points": "point3f[] points = [(0, 0, 0)]\n",
    "PointInstancer": """int[] protoIndices = [0]
point3f[] positions = [(1, 2, 3)]
rel prototypes = <BALL>
def Sphere "ball"
{
}
""",
    "DomeLight": "rel portals = </p0>\n",
}
_MORE = {  # which no schema lists, but readers know
    "Xform": """xformOp:translate xformOp:scale xformOp:rotateX xformOp:rotateXYZ xformOp:orient xformOp:transform
        xformOp:translateX primvars:displayColor primvars:displayOpacity""",
    "Mesh": "primvars:displayColor primvars:displayOpacity primvars:normals primvars:st primvars:displayColor:indices",
    "Points": "primvars:displayColor primvars:widths",
    "PointInstancer": "primvars:displayColor primvars:displayOpacity",
    "SphereLight": "treatAsPoint",
}
NODES = {
    "UsdPreviewSurface": """diffuseColor emissiveColor useSpecularWorkflow specularColor metallic roughness clearcoat
        clearcoatRoughness opacity opacityMode opacityThreshold ior normal displacement occlusion""",
    "UsdUVTexture": "file st wrapS wrapT fallback scale bias sourceColorSpace",
    "UsdPrimvarReader_float2": "varname fallback",
    "UsdTransform2d": "in rotation scale translation",
}
_NETWORK = """def Mesh "mesh" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
FACES
rel material:binding = </m>
}
def Material "m"
{
    token outputs:surface.connect = </m/UsdPreviewSurface.outputs:surface>
    def Shader "UsdPreviewSurface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/UsdUVTexture.outputs:rgb>
        token outputs:surface
    }
    def Shader "UsdUVTexture"
    {
        uniform token info:id = "UsdUVTexture"
        float2 inputs:st.connect = </m/UsdTransform2d.outputs:result>
        float3 outputs:rgb
    }
    def Shader "UsdTransform2d"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </m/UsdPrimvarReader_float2.outputs:result>
        float2 outputs:result
    }
    def Shader "UsdPrimvarReader_float2"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
""".replace("FACES", _FACES)
# Of these a stage has one that counts.
_ONE = ("Camera", "RenderSettings", "RenderProduct", "RenderVar", "SkelAnimation", "Skeleton", "SkelRoot")
_AROUND = """def SkelRoot "SkelRoot"
{
    def Mesh "mesh" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
FACES
        rel skel:skeleton = </SkelRoot/Skeleton>
        int[] primvars:skel:jointIndices = [0, 0, 0] (
            elementSize = 1
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1] (
            elementSize = 1
            interpolation = "vertex"
        )
    }
    def Skeleton "Skeleton" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token[] joints = ["a"]
        uniform matrix4d[] bindTransforms = [( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )]
        uniform matrix4d[] restTransforms = [( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )]
        rel skel:animationSource = </SkelRoot/Skeleton/SkelAnimation>
        def SkelAnimation "SkelAnimation"
        {
            uniform token[] joints = ["a"]
            float3[] translations = [(0, 0, 1)]
            quatf[] rotations = [(1, 0, 0, 0)]
            half3[] scales = [(1, 1, 1)]
        }
    }
}
def Camera "Camera"
{
}
def RenderSettings "RenderSettings"
{
    rel products = </RenderSettings/RenderProduct>
    def RenderProduct "RenderProduct"
    {
        rel orderedVars = </RenderSettings/RenderProduct/RenderVar>
        def RenderVar "RenderVar"
        {
        }
    }
}
""".replace("FACES", _FACES)


def schemas() -> dict[str, list[str]]:
    """Names of the concrete schemas of LIBRARIES, each with its attributes."""
    registry, found = Usd.SchemaRegistry(), {}
    for known in Tf.Type.FindByName("UsdTyped").GetAllDerivedTypes():
        if Usd.SchemaRegistry.IsConcrete(known) and known.typeName.startswith(LIBRARIES):
            name = Usd.SchemaRegistry.GetSchemaTypeName(known)
            found[str(name)] = _attributes(registry.FindConcretePrimDefinition(name)) + _MORE.get(str(name), "").split()
    return dict(sorted(found.items()))


def applied() -> dict[str, list[str]]:
    """The same of schemas that are applied, those of many names as `NAME:one`."""
    registry, found = Usd.SchemaRegistry(), {}
    for known in Tf.Type.FindByName("UsdAPISchemaBase").GetAllDerivedTypes():
        if Usd.SchemaRegistry.IsAppliedAPISchema(known):
            name = str(Usd.SchemaRegistry.GetSchemaTypeName(known))
            many = Usd.SchemaRegistry.IsMultipleApplyAPISchema(known)
            names = [n.replace("__INSTANCE_NAME__", "one") for n in _attributes(registry.FindAppliedAPIPrimDefinition(name))]
            if names:
                found[f"{name}:one" if many else name] = names
    return dict(sorted(found.items()))


def _attributes(definition: Usd.PrimDefinition) -> list[str]:
    names = definition.GetPropertyNames()
    return [str(name) for name in names if definition.GetSpecType(name) == Sdf.SpecTypeAttribute]


def of_schema(name: str, attributes: list[str], kind: str) -> Iterator[tuple[str, str]]:
    """Stages by what is wrong in them, as text: one, or one for each attribute where only one prim of a stage counts."""
    if name in _ONE:
        yield f"{name} all {kind}", _around(name, attributes, kind)
        for attribute in attributes:
            yield f"{name} {attribute} {kind}", _around(name, [attribute], kind)
        return
    layer = Sdf.Layer.CreateAnonymous(".usda")
    prims = [f'def {name} "p{i}"\n{{\n{_base(name, i)}}}\n' for i in range(len(attributes) + 1)]
    assert layer.ImportFromString("#usda 1.0\n" + "".join(prims))
    for i, attribute in enumerate(attributes):
        _author(layer, f"/p{i}", [attribute], kind)
    _author(layer, f"/p{len(attributes)}", attributes, kind)
    yield f"{name} {kind}", layer.ExportToString()


def of_applied(name: str, attributes: list[str], kind: str) -> str:
    """On shapes, lights and cameras: a prim for each attribute and one for all."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    text, places = "#usda 1.0\n", []
    for host in ("Mesh", "SphereLight", "Camera", "Xform"):
        for i, some in enumerate([*([attribute] for attribute in attributes), attributes]):
            text += f'def {host} "{host}{i}" (\n prepend apiSchemas = ["{name}"]\n)\n{{\n{_base(host, i)}}}\n'
            places.append((f"/{host}{i}", some))
    assert layer.ImportFromString(text)
    for path, some in places:
        _author(layer, path, some, kind)
    return str(layer.ExportToString())


def of_nodes(kind: str) -> Iterator[tuple[str, str]]:
    """Of the shaders that are read: each input, and whatever else is asked of them."""
    for node, inputs in NODES.items():
        names = [f"inputs:{name}" for name in inputs.split()] + ["info:id", "info:implementationSource"]
        for name in names:
            layer = Sdf.Layer.CreateAnonymous(".usda")
            assert layer.ImportFromString(f"#usda 1.0\n{_NETWORK}")
            _author(layer, f"/m/{node}", [name], kind)
            yield f"{node} {name} {kind}", layer.ExportToString()


def _around(name: str, attributes: list[str], kind: str) -> str:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(f"#usda 1.0\n{_AROUND}")
    paths: list[Sdf.Path] = []
    layer.Traverse("/", lambda path: paths.append(path))
    _author(layer, str(next(path for path in paths if path.IsPrimPath() and path.name == name)), attributes, kind)
    return str(layer.ExportToString())


def _base(name: str, number: int) -> str:
    return _BASES.get(name, "").replace("BALL", f"/p{number}/ball")


def _author(layer: Sdf.Layer, path: str, names: list[str], kind: str) -> None:
    """In place of what the prim has of these names; transform operations are put in order too."""
    prim = layer.GetPrimAtPath(path)
    operations = [name for name in names if name.startswith("xformOp:")]
    if operations and "xformOpOrder" not in names:
        order = Sdf.AttributeSpec(prim, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
        order.default = Vt.TokenArray(operations)
    for name in names:
        if name in prim.properties:
            del prim.properties[name]
        if kind == "relationship":
            Sdf.RelationshipSpec(prim, name)
            continue
        made = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
        if TYPES[kind] is not None:
            made.default = TYPES[kind]
