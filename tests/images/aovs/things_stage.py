"""A stage of labelled things that are nested, in native instances and in instances of point instancers."""

from __future__ import annotations

_CAM = """#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 0.01
)
def Camera "cam" {
    float focalLength = 20
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
_AT = """double3 xformOp:translate = (%g, %g, %g)
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""
LABELLED = '(%sprepend apiSchemas = ["SemanticsLabelsAPI:class"])'


def at(x: float, y: float, z: float = 0) -> str:
    return _AT % (x, y, z)


STAGE = (
    _CAM
    + f"""
class "_wheel" {LABELLED % ""} {{
    token[] semantics:labels:class = ["wheel"]
    def Cube "rim" {{
        double size = 0.5
    }}
}}
class "_car" {LABELLED % ""} {{
    token[] semantics:labels:class = ["vehicle", "car"]
    def Cube "body" {{
    }}
    def Xform "w0" (
        instanceable = true
        inherits = </_wheel>
    ) {{
        {at(1.5, 0)}
    }}
    def Xform "w1" (
        instanceable = true
        inherits = </_wheel>
    ) {{
        {at(-1.5, 0)}
    }}
}}
def Xform "world" {{
    def Xform "car0" (
        instanceable = true
        inherits = </_car>
    ) {{
        {at(0, 5)}
    }}
    def Xform "car1" (
        instanceable = true
        inherits = </_car>
    ) {{
        {at(5, 5)}
    }}
    def PointInstancer "lot" {{
        rel prototypes = [</world/lot/protos/car>, </world/lot/protos/tree>]
        int[] protoIndices = [0, 1, 0]
        point3f[] positions = [(-5, -4, 0), (1, -4, 0), (5, -4, 0)]
        def Scope "protos" {{
            def Xform "car" (
                instanceable = true
                inherits = </_car>
            ) {{
            }}
            def Xform "tree" {{
                def Sphere "crown" {LABELLED % ""} {{
                    token[] semantics:labels:class = ["crown"]
                }}
            }}
        }}
    }}
    def PointInstancer "apples" {LABELLED % ""} {{
        token[] semantics:labels:class = ["apple"]
        rel prototypes = [</world/apples/a>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(-5, 0, 0), (5, 0, 0)]
        def Sphere "a" {{
            double radius = 0.5
        }}
    }}
}}
def Points "dust" {LABELLED % ""} {{
    token[] semantics:labels:class = ["dust"]
    point3f[] points = [(-6, 5, 0), (-5, 5, 0)]
    float[] widths = [1, 1]
}}
def Cube "plain" {{
    double size = 0.5
    {at(0, 0)}
}}
"""
)
