"""Documents of MaterialX, and stages that refer to them, as text."""

from __future__ import annotations

from pathlib import Path

from primray.description import Surface
from primray.diagnostic_codes import Severity
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, translate

DEFAULTS = RenderSettings()

RED = """<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709" fileprefix="maps/">
  <nodegraph name="NG">
    <input name="scale" type="float" value="2"/>
    <image name="picture" type="color3">
      <input name="file" type="filename" value="wood.png" colorspace="srgb_texture"/>
    </image>
    <multiply name="scaled" type="color3">
      <input name="in1" type="color3" nodename="picture"/>
      <input name="in2" type="float" interfacename="scale"/>
    </multiply>
    <output name="out" type="color3" nodename="scaled"/>
  </nodegraph>
  <standard_surface name="SR_wood" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG" output="out"/>
    <input name="specular_roughness" type="float" value="0.25"/>
  </standard_surface>
  <surfacematerial name="Wood" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR_wood"/>
  </surfacematerial>
  <standard_surface name="SR_red" type="surfaceshader">
    <input name="base_color" type="color3" value="1, 0, 0"/>
  </standard_surface>
  <surfacematerial name="Red" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR_red"/>
  </surfacematerial>
</materialx>
"""

STAGE = """#usda 1.0
( defaultPrim = "World" )
def Xform "World"
{
    def Scope "Looks" ( references = @./looks.mtlx@</MaterialX/Materials> ) {}
    def Sphere "ball" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        rel material:binding = </World/Looks/Red>
    }
}
"""

QUAD = """#usda 1.0
( metersPerUnit = {meters} )
def Mesh "quad" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    rel material:binding = </Look>
}}
def Material "Look" ( references = @{document}@</MaterialX/Materials/M> ) {{}}
"""

UNLIT = """
  <surface_unlit name="S" type="surfaceshader"><input name="emission_color" type="color3" {given}/></surface_unlit>
  <surfacematerial name="M" type="material"><input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
"""


def unlit(nodes: str, head: str = "", given: str = 'nodename="c"') -> str:
    """Return a document with a material M that emits what node c of `nodes` gives; `head`: attributes of its root."""
    return f'<materialx version="1.39" {head}>{nodes}{UNLIT.format(given=given)}</materialx>'


def surface_of(
    folder: Path, document: str, meters: float = 1.0, settings: RenderSettings = DEFAULTS
) -> tuple[Surface, list[str]]:
    """Return the surface that material M of a document becomes, and the messages that are no mere information."""
    (folder / "looks.mtlx").write_text(document)
    return surface_at(folder, "looks.mtlx", meters, settings)


def surface_at(
    folder: Path, document: str, meters: float = 1.0, settings: RenderSettings = DEFAULTS
) -> tuple[Surface, list[str]]:
    """Return the same of a document that is there already."""
    (folder / "stage.usda").write_text(QUAD.format(document=document, meters=meters))
    diagnostics = Diagnostics()
    description, said = translate(open_stage(folder / "stage.usda", diagnostics), settings)
    (surface,) = description.surfaces
    return surface, [d.message for d in (*diagnostics, *said) if d.severity is not Severity.INFO]
