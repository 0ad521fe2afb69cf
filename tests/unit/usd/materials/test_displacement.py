"""What displaces a material's surface: which terminal counts, what becomes of it, and what is told."""

from __future__ import annotations

import numpy as np
import pytest
from tests.displaced import CUBE, POSITION, QUADS, described, materialx, node, preview

from primray.description import DisplacedMesh, Mesh, PatternInput, PrimvarInput, SubdivisionMesh, Surface, TextureInput

PLANE = QUADS.replace("SCHEME", "none")
IMAGE = node("t", "UsdUVTexture", "asset inputs:file = @FILE@\n float4 inputs:scale = (2, 2, 2, 2)", "float outputs:r")
VIEW = node("v", "ND_viewdirection_vector3", "", "float3 outputs:out") + node(
    "z", "ND_extract_vector3", "float3 inputs:in.connect = </m/v.outputs:out>\n int inputs:index = 2", "float outputs:out"
)


def found(text: str) -> tuple[Surface, list[tuple[str, str]]]:
    """The first shape's surface, and what is told of materials."""
    description, diagnostics = described(text)
    surface = description.surfaces[int(np.asarray(description.shapes[0].surface).flat[0])]
    other = ("default-light", "primvar-missing")
    return surface, [(d.code, d.prim_path) for d in diagnostics if d.code not in other and "camera" not in d.code]


@pytest.mark.conforms("UsdPreviewSurface.inputs:displacement", "UsdPreviewSurface.outputs:displacement")
def test_preview_surfaces_input() -> None:
    surface, told = found(PLANE + preview("float inputs:displacement = 0.5"))
    assert (surface.displacement, told) == (("displacement", PrimvarInput("", (0.5,))), [])
    assert found(PLANE + preview("float inputs:displacement = 0"))[0].displacement is None
    alone = preview("float inputs:displacement = 0.5").replace(
        "token outputs:displacement.connect = </m/s.outputs:displacement>", ""
    )
    assert found(PLANE + alone)[0] == surface


@pytest.mark.conforms("UsdPreviewSurface.inputs:displacement")
def test_a_texture(image: str) -> None:
    text = PLANE + preview("float inputs:displacement.connect = </m/t.outputs:r>", IMAGE)
    surface, told = found(text.replace("FILE", image))
    assert surface.displacement is not None
    name, value = surface.displacement
    assert (name, told) == ("displacement", [])
    assert isinstance(value, TextureInput)
    assert (value.channels, value.scale[0]) == ("r", 2)
    assert found(text.replace("FILE", "none.exr")) == (surface.without_displacement(), [("asset-missing", "/m/t")])


@pytest.mark.conforms("Material.outputs:displacement")
@pytest.mark.parametrize("terminal", ["outputs:mtlx:displacement", "outputs:displacement"])
def test_materialx(terminal: str) -> None:
    nodes = POSITION + node("n", "ND_noise3d_float", "float3 inputs:position.connect = </m/p.outputs:out>", "float outputs:out")
    text = materialx("float inputs:displacement.connect = </m/n.outputs:out>\n float inputs:scale = 3", nodes)
    surface, told = found(PLANE + text.replace("outputs:mtlx:displacement", terminal))
    assert surface.displacement is not None
    assert isinstance(surface.displacement[1], PatternInput)
    assert surface.pattern is not None
    assert [n.category for n in surface.pattern.nodes] == ["position", "noise3d", "multiply"]
    assert told == []


def test_a_graph_beside_the_surfaces_own() -> None:
    """Both are one pattern, in which the second comes after the first."""
    nodes = POSITION + node("n", "ND_noise3d_float", "float3 inputs:position.connect = </m/p.outputs:out>", "float outputs:out")
    text = materialx("float inputs:displacement.connect = </m/n.outputs:out>", nodes).replace(
        "token outputs:surface\n    }", "float inputs:roughness.connect = </m/n.outputs:out>\n token outputs:surface\n    }"
    )
    surface, _ = found(PLANE + text)
    assert surface.pattern is not None
    assert [n.category for n in surface.pattern.nodes] == ["position", "noise3d"] * 2
    assert surface.displacement is not None
    assert isinstance(surface.displacement[1], PatternInput)
    assert surface.displacement[1].source.node == 3
    left = surface.without_displacement()
    assert [name for name, _ in left.inputs] == ["roughness"]
    assert left.pattern is surface.pattern


@pytest.mark.parametrize(("space", "name"), [("", "tangent"), ('token inputs:space = "object"', "object")])
def test_vectors(space: str, name: str) -> None:
    surface, told = found(PLANE + materialx(f"vector3f inputs:displacement = (1, 2, 3)\n {space}", kind="vector3"))
    assert (surface.displacement, told) == ((f"displacement_{name}", PrimvarInput("", (1, 2, 3))), [])


@pytest.mark.parametrize(
    ("text", "path"),
    [
        (PLANE + materialx("float inputs:displacement.connect = </m/z.outputs:out>", VIEW), "/m"),
        (PLANE + materialx("").replace("ND_displacement_float", "SomeDisplacement"), "/m"),
        (
            PLANE + preview("float inputs:displacement.connect = </m/x.outputs:r>", node("x", "Other", "", "float outputs:r")),
            "/m/s",
        ),
        (
            PLANE + preview("float inputs:displacement = 1").replace("UsdPreviewSurface", "OtherSurface"),
            "/m",
        ),
        (
            'def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {\n rel material:binding = </m>\n}\n'
            + preview("float inputs:displacement = 1"),
            "/ball",
        ),
        (
            'def Cube "box" (prepend apiSchemas = ["MaterialBindingAPI"]) {\n rel material:binding = </m>\n}\n'
            + preview("float inputs:displacement = 1"),
            "/box",
        ),
    ],
)
def test_what_is_not_displaced_is_told(text: str, path: str) -> None:
    surface, told = found(text)
    assert ("displacement", path) in told
    assert surface.displacement is None


@pytest.mark.parametrize(
    ("material", "reach"),
    [
        (preview("float inputs:displacement = -0.5"), 0.5),
        (preview("float inputs:displacement.connect = </m/t.outputs:r>", IMAGE), 2),
        (materialx("vector3f inputs:displacement = (3, 0, 4)", kind="vector3"), 5),
    ],
)
def test_boxes_hold_what_is_displaced(material: str, reach: float, image: str) -> None:
    """As far as it is known, for cameras that look at all there is."""
    (shape,) = described(PLANE + material.replace("FILE", image))[0].shapes
    low, high = shape.box()
    np.testing.assert_allclose([low, high], [[-reach] * 3, [2 + reach, 2 + reach, reach]])


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_shapes_are_cages_only_where_something_displaces_them(scheme: str) -> None:
    cube = CUBE.replace("SCHEME", scheme)
    (moved,) = described(cube + preview("float inputs:displacement = 1"))[0].shapes
    (still,) = described(cube + preview(""))[0].shapes
    assert type(moved) is DisplacedMesh
    assert type(still) is (Mesh if scheme == "none" else SubdivisionMesh)
    assert moved.scheme == ("bilinear" if scheme == "none" else scheme)
    assert moved.face_counts.tolist() == [4] * 6
