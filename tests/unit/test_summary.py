"""Counts and memory of a description, for inspect."""

from __future__ import annotations

from pxr import Usd

from primray.settings import RenderSettings
from primray.summary import summary
from primray.usd import translate

INSTANCED = """#usda 1.0
def Cube "alone"
{
}
def PointInstancer "field"
{
    rel prototypes = </field/both>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]
    def Xform "both"
    {
        def Cube "box"
        {
        }
        def Sphere "ball"
        {
        }
    }
}
"""


def test_counts_unique_and_instanced() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(INSTANCED)
    found = summary(translate(stage, RenderSettings())[0])
    assert (found.meshes, found.spheres, found.triangles_unique) == (2, 1, 24)
    assert (found.triangles_instanced, found.spheres_instanced) == (12 + 3 * 12, 3)
    assert (found.prototypes, found.instances) == (1, 3)
    assert found.camera == ""
    assert [light.type for light in found.lights] == ["dome"]
    assert found.memory_bytes > 24 * 100 + 3 * 216
    assert found.as_json()["lights"][0]["path"] == "primray:default-light"
