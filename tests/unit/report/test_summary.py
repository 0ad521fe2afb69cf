"""Counts and memory of a description, for inspect."""

from __future__ import annotations

import pytest
from pxr import Usd

from primray import core
from primray.report.summary import ImageSize, summary
from primray.settings import RenderSettings
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
    assert [light.type for light in found.lights] == ["dome", "distant"]
    assert found.memory_bytes > 24 * 100 + 3 * 216
    assert found.as_json()["lights"][0]["path"] == "primray:default-light"


def test_images_count_as_stored_one_as_floats_and_by_the_view() -> None:
    stage = Usd.Stage.CreateInMemory()
    description, _ = translate(stage, RenderSettings(resolution=(100, 100)))

    def more(*images: ImageSize) -> float:
        return summary(description, images=images).memory_bytes - summary(description).memory_bytes

    small, large = ImageSize(100, 100, 3, 1), ImageSize(4000, 4000, 3, 1)
    assert more(large) > 4000 * 4000 * 3 * (1 + 4)
    assert more(large, large) - more(large) < 4000 * 4000 * 3 * 1.1  # the second one never stands as floats beside the first
    assert more(small, large) - more(large) == pytest.approx(100 * 100 * 3 * (1 + 2 * 4 / 3), abs=2)


def test_points_at_other_times_count() -> None:
    """As arrays of a mesh, twice as all of them; and a cage's for each vertex that is diced."""

    def bytes_of(points: str, scheme: str) -> int:
        stage = Usd.Stage.CreateInMemory()
        text = CAGE.replace("point3f[] points = ", points).replace("{", f'{{\nuniform token subdivisionScheme = "{scheme}"', 1)
        eye = 'def Camera "eye"\n{\ndouble shutter:close = 1\nmatrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), '
        eye += '(0, 0, 1, 0), (0, 0, 9, 1))\nuniform token[] xformOpOrder = ["xformOp:transform"]\n}\n'
        assert stage.GetRootLayer().ImportFromString(text + eye)
        return summary(translate(stage, RenderSettings(time_code=1.0, resolution=(320, 240)))[0]).memory_bytes

    moving = CAGE[CAGE.index("[(") : CAGE.index(")]") + 2]
    still, moved = (
        "point3f[] points = ",
        f"point3f[] points.timeSamples = {{ 1: {moving}, 2: {moving.replace('-1', '-2')} }}\n#",
    )
    assert bytes_of(moved, "none") - bytes_of(still, "none") >= 2 * 2 * 8 * 12
    assert bytes_of(moved, "catmullClark") - bytes_of(still, "catmullClark") > 2000 * 2 * 24


CAGE = """#usda 1.0
def Mesh "cage"
{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    point3f[] points = [(-1,-1,-1), (-1,-1,1), (-1,1,-1), (-1,1,1), (1,-1,-1), (1,-1,1), (1,1,-1), (1,1,1)]
}
"""


def test_triangles_of_cages_are_estimated() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(CAGE)
    description, _ = translate(stage, RenderSettings(resolution=(200, 200)))
    found = summary(description, 4.0)
    assert (found.meshes, found.cages, found.spheres) == (0, 1, 0)
    diced, warnings = core.dice(description, RenderSettings(resolution=(200, 200), dicing_rate=4.0))
    triangles = summary(diced).triangles_unique
    assert triangles / 1.5 < found.triangles_unique < 1.5 * triangles
    assert warnings == []
    assert summary(description, 16.0).triangles_unique < found.triangles_unique


def test_flat_cages_are_estimated_as_they_are_diced() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(
        CAGE.replace('Mesh "cage"\n{', 'Mesh "cage"\n{\n    token subdivisionScheme = "bilinear"')
    )
    description, _ = translate(stage, RenderSettings(resolution=(200, 200)))
    assert summary(description, 1.0).triangles_unique == 12
