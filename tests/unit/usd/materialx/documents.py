"""Documents of MaterialX, and stages that refer to them, as text."""

from __future__ import annotations

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
