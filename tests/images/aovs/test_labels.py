"""Semantic labels as ids with a table, by the schema and by the older attributes; boxes and matrices in the report."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import primray

SQUARE = """def Mesh "%s" %s{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(%g, 0, 0), (%g, 0, 0), (%g, 1, 0), (%g, 1, 0)]
        uniform token subdivisionScheme = "none"
        %s
    }
"""
STAGE = (
    """#usda 1.0
(upAxis = "Y")
def Camera "cam" {
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "street" (prepend apiSchemas = ["SemanticsLabelsAPI:class"]) {
    token[] semantics:labels:class = ["outdoor"]
"""
    + SQUARE
    % (
        "car",
        '(prepend apiSchemas = ["SemanticsLabelsAPI:class"]) ',
        -2,
        -1,
        -1,
        -2,
        'token[] semantics:labels:class = ["car"]',
    )
    + SQUARE
    % (
        "old",
        "",
        -1,
        0,
        0,
        -1,
        'string semantic:S:params:semanticType = "class"\n        string semantic:S:params:semanticData = "kerb"',
    )
    + SQUARE % ("plain", "", 0, 1, 1, 0, "")
    + "}\n"
    + SQUARE % ("alone", "", 1, 1.5, 1.5, 1, "")
    + """def PointInstancer "trees" (prepend apiSchemas = ["SemanticsLabelsAPI:class"]) {
    token[] semantics:labels:class = ["tree"]
    rel prototypes = </trees/p>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(-2, -1, 0), (1, -1, 0)]
    def Xform "p" {
"""
    + SQUARE % ("leaf", "", 0, 0.5, 0.5, 0, 'token[] semantics:labels:other = ["green"]')
    + "}\n}\n"
)


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> primray.Image:
    path = tmp_path_factory.mktemp("labels") / "s.usda"
    path.write_text(STAGE)
    return primray.render(path, aovs=["labels:class", "labels:other"], resolution=(40, 20), spp=1, progress=False)


def _at(image: primray.Image, x: float, y: float, name: str = "labels:class") -> str:
    """What is at a point of the world."""
    column, row = int((x + 2) * 10), int((1 - y) * 10)
    aov = image.aovs[name]
    return aov.ids.get(int(aov.values[row, column, 0]), "")


def test_labels_are_inherited_and_joined(image: primray.Image) -> None:
    assert _at(image, -1.5, 0.5) == "car,outdoor"
    assert _at(image, -0.5, 0.5) == "kerb,outdoor"
    assert _at(image, 0.5, 0.5) == "outdoor"
    assert _at(image, 1.25, 0.5) == ""
    assert _at(image, -1.75, -0.5) == _at(image, 1.25, -0.5) == "tree"
    assert _at(image, 1.25, -0.5, "labels:other") == "green"
    assert image.aovs["labels:class"].ids == {1: "car,outdoor", 2: "kerb,outdoor", 3: "outdoor", 4: "tree"}


def test_boxes_are_of_every_object(image: primray.Image) -> None:
    boxes = {row["object"]: row for row in image.report["labels"]["boxes"]["labels:class"]}
    assert boxes["/street/car"] == {"label": "car,outdoor", "object": "/street/car", "box": [0, 0, 10, 10], "pixels": 100}
    assert boxes["/trees[0]"]["box"] == [0, 10, 5, 20]
    assert boxes["/trees[1]"]["box"] == [30, 10, 35, 20]
    assert "/alone" not in boxes
    ndc = np.array(image.report["labels"]["camera"]["world_to_ndc"])
    seen = ndc @ [-2, 1, 0, 1]
    np.testing.assert_allclose(seen[:2] / seen[3], [0, 0], atol=1e-6)  # the car's upper left corner
    json.dumps(image.report)


def test_matrices_are_those_of_opencv_and_opengl(image: primray.Image) -> None:
    says = image.report["labels"]["camera"]
    assert image.camera is not None
    assert says["distortion"] is None
    if says["intrinsics"] is not None:
        np.testing.assert_array_equal(says["intrinsics"], image.camera.intrinsics(image.resolution))
    np.testing.assert_array_equal(says["opencv_camera_from_world"], image.camera.opencv_camera_from_world)
    corner = np.array(says["opengl_projection"]) @ np.array(says["opengl_camera_from_world"]) @ [-2, 1, 0, 1]
    np.testing.assert_allclose(corner[:2] / corner[3], [-1, 1], atol=1e-6)  # the car's upper left corner


def test_a_perspective_picture_says_its_intrinsic_matrix(tmp_path: Path) -> None:
    path = tmp_path / "s.usda"
    path.write_text('#usda 1.0\ndef Sphere "ball" {}\n')
    k = [[100.0, 0.0, 30.0], [0.0, 90.0, 25.0], [0.0, 0.0, 1.0]]
    camera = primray.Camera.from_intrinsics(k, (64, 48), primray.looking_at((0, 0, 9), (0, 0, 0)), (0.1, 0.0, 0.0, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", primray.RenderWarning)
        image = primray.render(path, camera=camera, aovs=["labels:class"], resolution=(64, 48), spp=1, progress=False)
    says = image.report["labels"]["camera"]
    assert image.camera is not None
    np.testing.assert_allclose(says["intrinsics"], k)
    assert says["distortion"]["coefficients"][0] == 0.1
    assert says["opengl_projection"] is None
    np.testing.assert_array_equal(says["opencv_camera_from_world"], [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 9], [0, 0, 0, 1]])


def test_a_file_has_the_table(image: primray.Image, tmp_path: Path) -> None:
    path = image.save(tmp_path / "a.exr")
    again = primray.read_image(path)
    assert again.aovs["labels:class"].ids == image.aovs["labels:class"].ids
    np.testing.assert_array_equal(again.aovs["labels:class"].values, image.aovs["labels:class"].values)
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    assert file.spec().get_string_attribute("worldToCamera") is not None
