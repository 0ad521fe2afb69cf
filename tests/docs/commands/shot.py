"""Write the files that printed commands name: a shot with what they ask of it, and what earlier commands would have left."""

from __future__ import annotations

from pathlib import Path

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    renderSettingsPrimPath = "/Render/settings"
    startTimeCode = 1
    endTimeCode = 100
)

def Xform "World"
{
    def Camera "cam"
    {
        float2 clippingRange = (0.1, 100)
        double3 xformOp:translate = (0, 0, 8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Xform "car" (
        variants = {
            string color = "blue"
        }
        prepend variantSets = "color"
        payload = @./body.usda@
    )
    {
        variantSet "color" = {
            "blue" {
                over "body"
                {
                    color3f[] primvars:displayColor = [(0.1, 0.2, 0.8)]
                }
            }
            "red" {
                over "body"
                {
                    color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]
                }
            }
        }
    }

    def DistantLight "key"
    {
        float inputs:intensity = 3
        string primray:lightGroup = "key"
    }
}

def Xform "rig"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Camera "left"
    {
        uniform token stereoRole = "left"
        double3 xformOp:translate = (-0.03, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Camera "right"
    {
        uniform token stereoRole = "right"
        double3 xformOp:translate = (0.03, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}

def Scope "Render"
{
    def RenderSettings "settings"
    {
        rel camera = </World/cam>
        rel products = [</Render/beauty>]
        uniform int2 resolution = (960, 540)
    }

    def RenderProduct "beauty"
    {
        token productName = "beauty.exr"
    }
}
"""

BODY = """#usda 1.0
(
    defaultPrim = "car"
)

def Xform "car"
{
    def Sphere "body" (
        prepend apiSchemas = ["SemanticsLabelsAPI:class"]
    )
    {
        token[] semantics:labels:class = ["car"]
        double radius = 1
    }
}
"""

OVER = """#usda 1.0

over "World"
{
    over "car"
    {
        double3 xformOp:translate = (0.5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


def write_shot(folder: Path) -> None:
    (folder / "shot.usda").write_text(STAGE)
    (folder / "body.usda").write_text(BODY)
    (folder / "over.usda").write_text(OVER)
    (folder / "assets").mkdir()
    (folder / "assets" / "car.usda").write_text(BODY.replace('"car"\n)', '"car"\n    metersPerUnit = 1\n)'))
