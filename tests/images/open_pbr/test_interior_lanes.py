"""Paths among bodies have the same bits at any number of lanes and threads, split or not, in parts or in one."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

import primray
from primray.core import CoreScene, native, passes
from primray.core.scene import Splits

from .worn import light, wear

MOST = native.lanes()
GLASS = {"transmission_weight": 1.0, "specular_roughness": 0.0}
AIR = {**GLASS, "specular_weight": 0.0, "transmission_depth": 0.3}
SKIN = {"subsurface_weight": 1.0, "subsurface_color": (0.9, 0.6, 0.4), "subsurface_radius": 0.2}
# Material, centre, radius: bodies beside each other, in each other and across each other.
BODIES: tuple[tuple[dict[str, object], tuple[float, float, float], float], ...] = (
    (SKIN, (-1.5, 0.0, 0.0), 0.5),
    ({**SKIN, "subsurface_weight": 0.6, "subsurface_scatter_anisotropy": 0.6, "coat_weight": 1.0}, (-0.5, 0.1, 0.2), 0.45),
    ({"base_color": (0.1, 0.2, 0.8)}, (-1.5, 0.1, 0.2), 0.2),  # within the first
    ({**AIR, "transmission_color": (0.9, 0.5, 0.4), "transmission_scatter": (0.5, 0.6, 0.9)}, (0.5, 0.0, 0.0), 0.5),
    ({**GLASS, "transmission_depth": 0.5, "transmission_color": (0.3, 0.8, 0.5)}, (1.4, 0.0, 0.0), 0.5),
    ({**GLASS, "specular_ior": 1.2}, (1.4, 0.1, 0.1), 0.3),  # within the last one
    ({**GLASS, "specular_ior": 1.33, "specular_roughness": 0.2}, (1.0, 0.3, 0.3), 0.35),  # across two
    ({"specular_roughness": 0.1}, (1.6, -0.1, -0.1), 0.2),  # no body of its own, in one: it meets that one's index
    ({**GLASS, "geometry_thin_walled": True}, (1.2, -0.25, 0.2), 0.2),
    ({}, (0.0, -100.6, 0.0), 100.0),
)


def bodies(cubes: bool = False) -> Usd.Stage:
    """Meshes are shaded in the order of their surfaces, as they are of so many; spheres are not."""
    stage = Usd.Stage.CreateInMemory()
    for k, (inputs, centre, radius) in enumerate(BODIES):
        ball: UsdGeom.Sphere | UsdGeom.Cube
        if cubes:
            ball = UsdGeom.Cube.Define(stage, f"/ball{k}")
            ball.CreateSizeAttr(2 * radius)
        else:
            ball = UsdGeom.Sphere.Define(stage, f"/ball{k}")
            ball.CreateRadiusAttr(radius)
        ball.AddTranslateOp().Set(Gf.Vec3d(centre))
        wear(ball, f"/m{k}", inputs, "ND_open_pbr_surface_surfaceshader")
    light(stage)
    return stage


@pytest.mark.parametrize("cubes", [False, True], ids=["spheres", "cubes"])
@pytest.mark.parametrize("splits", [1, 4])
def test_lanes_and_threads_do_not_show(monkeypatch: pytest.MonkeyPatch, splits: int, cubes: bool) -> None:
    stage = bodies(cubes)
    monkeypatch.setattr(CoreScene, "splits", lambda *_: Splits(splits, splits))
    pictures = []
    for lanes, threads in ((1, 1), (4, 2), (0, 1)):
        settings = primray.RenderSettings(resolution=(48, 27), spp=16, threads=threads)
        monkeypatch.setattr(passes, "lanes", lambda lanes=lanes: lanes or MOST)
        pictures.append(np.asarray(primray.render(stage, settings).pixels))
    assert np.isfinite(pictures[0]).all()
    assert pictures[0][..., :3].mean() > 0.2
    for other in pictures[1:]:
        np.testing.assert_array_equal(pictures[0], other)
