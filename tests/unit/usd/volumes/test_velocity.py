"""Velocities of volumes: their units, their factors, what they reach, and what is reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests import vdb_writer as vdb
from tests.unit.usd.volumes.volume_text import ACTIVE, VOXELS, field_text, grid, translated, volume_text, write

from primray.settings import RenderSettings

OPEN = RenderSettings(time_code=0, shutter=(-0.25, 0.5))
SCALED = ("UniformScaleMap", vdb.scale_map(0.5, 0.5, 0.5))
WIND = (12.0, -24.0, 0.0)


def blurred(folder: Path, fields: dict[str, str], settings: RenderSettings = OPEN, **more: Any) -> tuple[Any, Any, Any]:
    """The blur of the only medium, the diagnostics and their messages."""
    description, told, messages = translated(folder, volume_text(fields, **more), settings)
    (medium,) = description.media
    return medium.blur, told, messages


@pytest.mark.parametrize("name", ["velocity", "vel", "v"])
def test_velocities_are_per_second_in_the_space_of_their_field(tmp_path: Path, name: str) -> None:
    write(tmp_path, grid(transform=SCALED), grid(WIND, name=name, kind="vec3s", transform=SCALED))
    blur, told, messages = blurred(tmp_path, {"density": "", name: ""})
    # A second has 24 time codes, of which the shutter is open for 0.75; a voxel is half a unit wide.
    expected = np.array(WIND) / 24 * 0.75 / 0.5
    found = blur.velocity.leaf_values.reshape(-1, 3)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-6)
    assert blur.frame == pytest.approx(1 / 3)
    assert {code for code, _ in told} == {"volume-convention"}
    assert f"it is blurred by the velocities of the field {name}" in messages[0]


def test_where_velocities_carry_it(tmp_path: Path) -> None:
    """From 0 to 8 it is carried from -6 * 2 / 3 to 6 * 1 / 3 voxels, which blocks of all around x cover."""
    write(tmp_path, grid(), grid((24 / 0.75 * 6, 0, 0), name="vel", kind="vec3s"))
    blur, _, _ = blurred(tmp_path, {"density": "", "vel": ""}, RenderSettings(time_code=0, shutter=(-0.5, 0.25)))
    origins = {tuple(origin) for origin in blur.velocity.leaf_origins.tolist()}
    assert {x for x, _, _ in origins} == {-8, 0, 8}
    assert {y for _, y, _ in origins} == {-8, 0, 8}
    np.testing.assert_allclose(blur.velocity.leaf_values[..., 0], 6, rtol=1e-6)


def test_what_stands_still_stays(tmp_path: Path) -> None:
    """Half of the smoke has no velocity: it gets none from the other half."""
    moves = np.where(VOXELS[:, :1] >= 4, [[0, 0, 320.0]], 0.0)
    write(tmp_path, grid(), grid(moves, name="vel", kind="vec3s"))
    blur, _, _ = blurred(tmp_path, {"density": "", "vel": ""})
    for z in (-1, 4, 9):
        places = np.array([[x, 3, z] for x in range(8)])
        found = blur.velocity.values_at(places)[:, 2]
        np.testing.assert_allclose(found[:2], 0, atol=1e-6)
        np.testing.assert_allclose(found[6:], 10, rtol=1e-6)


@pytest.mark.parametrize(
    ("extra", "factor"),
    [
        ("", 1.0),
        ("float primvars:arnold:velocity_scale = 0.5", 0.5),
        ("float primvars:arnold:velocity_scale = 0", None),
        ("float motion:blurScale = 2", 2.0),
        ("float motion:blurScale = 0", None),
    ],
)
def test_factors(tmp_path: Path, extra: str, factor: float | None) -> None:
    write(tmp_path, grid(), grid((32.0, 0, 0), name="vel", kind="vec3s"))
    text = volume_text({"density": "", "vel": ""}, extra).replace('"Smoke"', '"Smoke" (prepend apiSchemas = ["MotionAPI"])')
    description, _, messages = translated(tmp_path, text, OPEN)
    blur = description.media[0].blur
    assert (blur is None) == (factor is None)
    assert any("is blurred by" in message for message in messages) == (factor is not None)
    if blur is not None and factor is not None:
        np.testing.assert_allclose(blur.velocity.leaf_values[..., 0], factor, rtol=1e-6)


def test_a_field_that_turns_and_has_other_voxels(tmp_path: Path) -> None:
    write(tmp_path, grid(), grid((0, 32.0, 0), name="vel", kind="vec3s", transform=SCALED))
    turned = """
        double xformOp:rotateZ = 90
        double3 xformOp:translate = (0, -4, 0)
        uniform token[] xformOpOrder = ["xformOp:rotateZ", "xformOp:translate"]"""
    blur, _, _ = blurred(tmp_path, {"density": "", "vel": turned})
    # Its axis y is the world's -x, and its voxels, half as wide, cover [0, 4] x [0, 4].
    inside = blur.velocity.values_at(np.array([[1, 1, 1], [3, 2, 2]]))
    np.testing.assert_allclose(inside, [[-1, 0, 0]] * 2, atol=1e-6)


def test_no_time_and_no_vectors(tmp_path: Path) -> None:
    write(tmp_path, grid(), grid(WIND, name="vel", kind="vec3s"), grid(3.0, name="v"))
    for still in (RenderSettings(time_code=0), RenderSettings(time_code=0, shutter=(0.25, 0.25))):
        blur, told, _ = blurred(tmp_path, {"density": "", "vel": ""}, still)
        assert blur is None
        assert {code for code, _ in told} == {"volume-convention"}
    blur, told, messages = blurred(tmp_path, {"density": "", "v": ""})
    assert blur is None
    assert ("motion", "/Smoke") in told
    assert any("velocities have three" in message for message in messages)


def test_too_far(tmp_path: Path) -> None:
    write(tmp_path, grid(), grid((1e6, 1e6, 1e6), name="vel", kind="vec3s"))
    settings = RenderSettings(time_code=0, shutter=(-0.25, 0.5), max_memory_bytes=1 << 26)
    blur, told, messages = blurred(tmp_path, {"density": "", "vel": ""}, settings)
    assert blur is None
    assert ("motion", "/Smoke") in told
    assert any("not blurred by its velocities" in message for message in messages)


def test_inactive_velocities_are_extended(tmp_path: Path) -> None:
    """Velocities of active voxels alone, as sparse simulations write them, reach what is around them."""
    half = VOXELS[:, 0] < 4
    density = vdb.Grid(leaves={(0, 0, 0): vdb.Leaf(np.where(half, 1.0, 0.0), ACTIVE)})
    moves = vdb.Grid("vel", "vec3s", leaves={(0, 0, 0): vdb.Leaf(np.where(half[:, None], [[320.0, 0, 0]], 0.0), half)})
    write(tmp_path, density, moves)
    blur, _, _ = blurred(tmp_path, {"density": "", "vel": ""})
    np.testing.assert_allclose(blur.velocity.leaf_values[..., 0], 10, rtol=1e-6)


@pytest.mark.parametrize("names", [("vel.x", "vel.y", "vel.z"), ("v_x", "v_y", "v_z"), ("velocityX", "velocityY", "velocityZ")])
def test_three_fields_of_components_are_velocities(tmp_path: Path, names: tuple[str, str, str]) -> None:
    """The blur is that of one field of vectors, with the signs of the components."""
    rng = np.random.default_rng(3)
    wind = rng.uniform(-30, 30, (512, 3))
    parts = [grid(wind[:, axis], name=name, transform=SCALED) for axis, name in enumerate(names)]
    write(tmp_path, grid(transform=SCALED), grid(wind, name="vel", kind="vec3s", transform=SCALED), *parts)
    whole, _, _ = blurred(tmp_path, {"density": "", "vel": ""})
    fields = "".join(field_text(f"c{axis}", grid_name=name) for axis, name in enumerate(names))
    relationships = "".join(f"rel field:c{axis} = <c{axis}>\n" for axis in (2, 0, 1))
    found, told, messages = blurred(tmp_path, {"density": ""}, extra=relationships + fields)
    np.testing.assert_array_equal(found.velocity.leaf_origins, whole.velocity.leaf_origins)
    np.testing.assert_allclose(found.velocity.leaf_values, whole.velocity.leaf_values, rtol=1e-6)
    assert {code for code, _ in told} == {"volume-convention"}
    assert "by the velocities of the fields c0, c1 and c2" in messages[0]


def test_components_in_different_leaves_and_tiles(tmp_path: Path) -> None:
    """A component that has no value somewhere is 0 there."""
    parts = [grid(24.0, name="vel.x"), vdb.Grid(name="vel.y", leaves={(8, 0, 0): vdb.Leaf(np.full(512, 48.0), ACTIVE)})]
    parts.append(vdb.Grid(name="vel.z", leaves={}, tiles=[vdb.Tile((0, 0, 0), 8, 72.0)]))
    smoke = vdb.Grid(name="density", leaves={(x, 0, 0): vdb.Leaf(np.ones(512), ACTIVE) for x in (0, 8)})
    write(tmp_path, smoke, *parts)
    fields = "".join(f"rel field:{a} = <{a}>\n" + field_text(a, grid_name=f"vel.{a}") for a in "xyz")
    blur, _, _ = blurred(tmp_path, {"density": ""}, RenderSettings(time_code=0, shutter=(0, 1)), extra=fields)
    np.testing.assert_allclose(blur.velocity.values_at(np.array([[3, 3, 3], [11, 3, 3]])), [[1, 0, 3], [0, 2, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ("names", "transforms", "says"),
    [
        (("vel.x", "vel.y"), (SCALED, SCALED), "there are 2 of three components"),
        (("vel.x",), (SCALED,), "there is 1 of three components"),
        (
            ("vel.x", "vel.y", "vel.z"),
            (SCALED, SCALED, ("UniformScaleMap", vdb.scale_map(0.25, 0.25, 0.25))),
            "the components differ in their transforms",
        ),
    ],
)
def test_components_that_cannot_be_joined_are_reported(tmp_path: Path, names: Any, transforms: Any, says: str) -> None:
    parts = [grid(-2.0, name=name, transform=transform) for name, transform in zip(names, transforms, strict=True)]
    write(tmp_path, grid(transform=SCALED), *parts)
    fields = "".join(f"rel field:{name[-1]} = <{name[-1]}>\n" + field_text(name[-1], grid_name=name) for name in names)
    blur, told, messages = blurred(tmp_path, {"density": ""}, extra=fields)
    assert blur is None
    assert told == [("motion", "/Smoke"), ("volume-convention", "/Smoke")]
    assert says in messages[0]
    closed = blurred(tmp_path, {"density": ""}, RenderSettings(time_code=0), extra=fields)[1]
    assert closed == [("volume-convention", "/Smoke")]  # nothing reads them
