"""A small shot with what a farm asks for: a variant, a light group, a product."""

from __future__ import annotations

from pathlib import Path

STAGE = """#usda 1.0
(
    renderSettingsPrimPath = "/Render/settings"
)
def Xform "World"
{
    def Xform "car" (
        variants = {
            string color = "blue"
        }
        prepend variantSets = "color"
    )
    {
        variantSet "color" = {
            "blue" {
                over "body"
                {
                    color3f[] primvars:displayColor = [(0, 0, 1)]
                }
            }
            "red" {
                over "body"
                {
                    color3f[] primvars:displayColor = [(1, 0, 0)]
                }
            }
        }
        def Sphere "body"
        {
        }
    }
    def Camera "cam"
    {
        double3 xformOp:translate = (0, 0, 8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "sky"
    {
        string karma:light:lpetag = "key"
    }
}
def Scope "Render"
{
    def RenderSettings "settings"
    {
        rel camera = </World/cam>
        rel products = </Render/product>
        uniform int2 resolution = (32, 18)
    }
    def RenderProduct "product"
    {
        token productName = "car.$F4.exr"
    }
}
"""


def write_shot(folder: Path) -> Path:
    path = folder / "the shot.usda"
    path.write_text(STAGE)
    return path
