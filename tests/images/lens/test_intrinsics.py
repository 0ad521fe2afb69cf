"""Pictures through an intrinsic matrix: bright squares are where OpenCV projects them, at pixels that are not square too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import primray

RESOLUTION = (160, 100)
PLACES = np.array([(-0.6, 0.3, -3.0), (0.5, -0.25, -2.5), (0.1, 0.05, -4.0)])
STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Mesh "square"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [%s]
    rel material:binding = </glow>
}
def Material "glow"
{
    token outputs:surface.connect = </glow/surface.outputs:surface>
    def Shader "surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor = (1, 1, 1)
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize("coefficients", [(), (-0.25, 0.08, 0.01, -0.01)])
@pytest.mark.parametrize("fy", [150.0, 110.0])
def test_squares_are_where_opencv_projects_them(tmp_path: Path, fy: float, coefficients: tuple[float, ...]) -> None:
    cv2 = pytest.importorskip("cv2")
    k = np.array([[150.0, 0.0, 75.2], [0.0, fy, 52.7], [0.0, 0.0, 1.0]])
    pose = primray.looking_at((1.0, 2.0, 3.0), (0.2, 0.4, -0.3))
    camera = primray.Camera.from_intrinsics(k, RESOLUTION, pose, coefficients)
    view = camera.opencv_camera_from_world
    for number, place in enumerate(PLACES):
        corners = place + 0.02 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
        world = corners @ pose[:3, :3].T + pose[:3, 3]
        path = tmp_path / f"{number}.usda"
        path.write_text(STAGE % ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in world))
        image = primray.render(path, camera=camera, resolution=RESOLUTION, spp=256, filter="box", progress=False)
        weights = image.pixels[..., 0].astype(np.float64)
        x, y = np.meshgrid(np.arange(RESOLUTION[0]), np.arange(RESOLUTION[1]))
        found = np.array([(weights * x).sum(), (weights * y).sum()]) / weights.sum()
        middle = (place @ pose[:3, :3].T + pose[:3, 3])[None]
        expected, _ = cv2.projectPoints(
            middle, cv2.Rodrigues(view[:3, :3])[0], view[:3, 3], k, np.array(coefficients or [0.0] * 4)
        )
        np.testing.assert_allclose(found, expected[0, 0], atol=0.15)
    assert image.camera is not None
    np.testing.assert_allclose(image.camera.intrinsics(image.resolution), k, rtol=1e-9)
