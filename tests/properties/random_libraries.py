"""Random stages whose prototypes, materials and characters stand in libraries that are `class`, `over` or hidden `def`."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

HEAD = """#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
    startTimeCode = 0
    endTimeCode = 10
)
def Camera "cam"
{
    double shutter:open = -0.25
    double shutter:close = 0.25
    double3 xformOp:translate = (0, 0, 40)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
HOLDERS = {
    "class": ('class Xform "{name}"', ""),
    "typeless class": ('class "{name}"', ""),
    "over": ('over "{name}"', ""),
    "def": ('def Xform "{name}"', 'token visibility = "invisible"\n'),
}
MATRIX = "( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )"

Rng = np.random.Generator
Body = Callable[[Rng, str], str]  # by the path that it is to stand at


def stage_text(seed: int, kind: str) -> str:
    """One stage for a seed, its libraries being of one kind."""
    text = "".join(_parts(np.random.default_rng(seed)))
    head, more = HOLDERS[kind]
    for name in ("Lib", "Inner"):
        text = text.replace(f'HOLDER "{name}"\n{{\n', f"{head.format(name=name)}\n{{\n{more}")
    return text


def _parts(rng: Rng) -> Iterator[str]:
    bodies: tuple[Body, ...] = (painted, moving, character, crowd, model, lamp, extra)
    names = [f"p{k}" for k in range(int(rng.integers(2, 5)))]
    made = [bodies[int(rng.integers(len(bodies)))](rng, f"/Lib/{name}") for name in names]
    yield HEAD
    yield _library(names, made)
    yield instancer(rng, "many", [f"/Lib/{name}" for name in names])
    yield 'class "_extra"\n{\n' + character(rng, "/_extra/someone").replace("NAME", "someone", 1) + "}\n"
    yield 'def Xform "asset" (\n instanceable = true\n inherits = </_asset>\n)\n{\n}\n' * int(rng.integers(2))
    yield f'class Xform "_asset"\n{{\n{HELD}{instancer(rng, "inside", ["/_asset/Inner/leaf"])}}}\n'
    yield f'def Xform "g"\n{{\n color3f primvars:tint = {vector(rng)}\n{BOUND}}}\n'


def _library(names: list[str], made: list[str]) -> str:
    return (
        'HOLDER "Lib"\n{\n'
        + material("/Lib/M")
        + "".join(b.replace("NAME", n, 1) for n, b in zip(names, made, strict=True))
        + "}\n"
    )


def vector(rng: Rng) -> str:
    return "({:.3f}, {:.3f}, {:.3f})".format(*rng.uniform(0, 3, 3))


HELD = 'HOLDER "Inner"\n{\n def Cube "leaf"\n {\n  double size = 0.5\n }\n}\n'


BOUND = """ def Cube "c" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        rel material:binding = </Lib/M>
    }
"""


def instancer(rng: Rng, name: str, prototypes: list[str]) -> str:
    count = int(rng.integers(1, 6))
    places = ", ".join(vector(rng) for _ in range(count))
    tints = ", ".join(vector(rng) for _ in range(count))
    indices = ", ".join(str(rng.integers(len(prototypes))) for _ in range(count))
    targets = ", ".join(f"<{path}>" for path in prototypes)
    return f"""def PointInstancer "{name}"
{{
    rel prototypes = [{targets}]
    int[] protoIndices = [{indices}]
    point3f[] positions = [{places}]
    color3f[] primvars:tint = [{tints}] (
        interpolation = "vertex"
    )
}}
"""


def material(path: str) -> str:
    """Shows the colour primvar `tint`."""
    return f"""def Material "{path.rpartition("/")[2]}"
{{
    token outputs:surface.connect = <{path}/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = <{path}/r.outputs:result>
        token outputs:surface
    }}
    def Shader "r"
    {{
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tint"
        float3 outputs:result
    }}
}}
"""


def painted(rng: Rng, path: str) -> str:
    return f"""def Xform "NAME"
{{
    double3 xformOp:translate = {vector(rng)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Sphere "ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        rel material:binding = <{path}/M>
    }}
    {material(f"{path}/M")}
}}
"""


def moving(rng: Rng, path: str) -> str:
    return f"""def Xform "NAME"
{{
    double xformOp:translateX.spline = {{
        0: {rng.uniform(-1, 0):.3f}; post linear,
        10: {rng.uniform(0, 1):.3f},
    }}
    uniform token[] xformOpOrder = ["xformOp:translateX"]
    def Cube "box"
    {{
        double3 xformOp:translate.timeSamples = {{
            0: {vector(rng)},
            10: {vector(rng)},
        }}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
"""


def character(rng: Rng, path: str) -> str:
    return f"""def SkelRoot "NAME"
{{
    def Mesh "skin" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [{vector(rng)}, {vector(rng)}, {vector(rng)}]
        int[] primvars:skel:jointIndices = [0, 1, 0] (
            elementSize = 1
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1] (
            elementSize = 1
            interpolation = "vertex"
        )
        rel skel:skeleton = <{path}/bones>
    }}
    def Skeleton "bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token[] joints = ["a", "a/b"]
        uniform matrix4d[] bindTransforms = [{MATRIX}, {MATRIX}]
        uniform matrix4d[] restTransforms = [{MATRIX}, {MATRIX}]
        rel skel:animationSource = <{path}/wave>
    }}
    def SkelAnimation "wave"
    {{
        uniform token[] joints = ["a", "a/b"]
        quatf[] rotations = [(1, 0, 0, 0), (1, 0, 0, 0)]
        half3[] scales = [(1, 1, 1), (1, 1, 1)]
        float3[] translations.timeSamples = {{
            0: [(0, 0, 0), (0, 0, 0)],
            10: [{vector(rng)}, {vector(rng)}],
        }}
    }}
}}
"""


def crowd(rng: Rng, path: str) -> str:
    """Instances in a prototype, of what stands in a library of its own."""
    return f'def Xform "NAME"\n{{\n{HELD}{instancer(rng, "few", [f"{path}/Inner/leaf"])}}}\n'


def model(rng: Rng, path: str) -> str:
    """Drawn as its bounds."""
    return f"""def Xform "NAME" (
    prepend apiSchemas = ["GeomModelAPI"]
    kind = "component"
)
{{
    uniform token model:drawMode = "bounds"
    uniform bool model:applyDrawMode = 1
    def Cube "box"
    {{
        double3 xformOp:translate = {vector(rng)}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
"""


def lamp(rng: Rng, path: str) -> str:
    return f"""def Xform "NAME"
{{
    def SphereLight "light"
    {{
        float inputs:intensity = {rng.uniform(1, 5):.3f}
    }}
    def Sphere "globe"
    {{
        double radius = 0.25
    }}
}}
"""


def extra(rng: Rng, path: str) -> str:
    """A character in a native instance."""
    return 'def Xform "NAME" (\n instanceable = true\n inherits = </_extra>\n)\n{\n}\n'
