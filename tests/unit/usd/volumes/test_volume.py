"""Volume prims: where their fields are, which prims are instances, what is reported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Usd, UsdGeom
from tests import vdb_writer as vdb
from tests.unit.usd.volumes.volume_text import field_text, grid, translated, volume_text, write

from primray.settings import RenderSettings
from primray.usd import translate

SCALED = ("UniformScaleMap", vdb.scale_map(0.5, 0.5, 0.5))
CONVENTION = ("volume-convention", "/Smoke")


def test_without_a_material_it_is_as_in_storm(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0, transform=SCALED))
    description, told, messages = translated(tmp_path, volume_text())
    (medium,) = description.media
    assert medium.path == "/Smoke"
    assert medium.extinction == pytest.approx((1, 1, 1))
    assert medium.albedo == pytest.approx((0.18, 0.18, 0.18))
    assert medium.anisotropy == 0
    np.testing.assert_array_equal(medium.matrices, [np.diag([0.5, 0.5, 0.5, 1.0])])
    assert (medium.grid.leaf_values == 2).all()
    assert not description.volume_emissions
    assert told == [CONVENTION]
    assert "extinction is the field density per scene unit, with an albedo of 0.18" in messages[0]


@pytest.mark.conforms("Volume.field:NAME")
def test_a_field_has_a_transform_of_its_own(tmp_path: Path) -> None:
    write(tmp_path, grid())
    move = 'double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    text = f'def Xform "Up" {{ {move}\n {volume_text({"density": move}, move)} }}'
    (medium,) = translated(tmp_path, text)[0].media
    np.testing.assert_array_equal(medium.matrices[0, :3, 3], [3, 6, 9])


def test_a_field_elsewhere_is_where_its_namespace_says(tmp_path: Path) -> None:
    write(tmp_path, grid())
    move = 'double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    text = f"""
def Xform "Data" {{ {move} {field_text(extra=move)} }}
def Volume "Smoke" {{ rel field:density = </Data/density>
    double3 xformOp:scale = (7, 7, 7)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}}"""
    (medium,) = translated(tmp_path, text)[0].media
    np.testing.assert_array_equal(medium.matrices[0], [[1, 0, 0, 2], [0, 1, 0, 4], [0, 0, 1, 6], [0, 0, 0, 1]])


Triple = tuple[float, float, float]
NUMBERS = st.floats(-3, 3).map(lambda x: round(x, 2))
TRIPLES = st.tuples(NUMBERS, NUMBERS, NUMBERS)


@settings(max_examples=25, deadline=None)
@given(TRIPLES, TRIPLES, TRIPLES, st.booleans())
def test_matrices_are_those_of_usd(
    tmp_path_factory: pytest.TempPathFactory, move: Triple, turn: Triple, stretch: Triple, resets: bool
) -> None:
    folder = tmp_path_factory.mktemp("vdb")
    write(folder, grid(transform=SCALED))
    stage = Usd.Stage.CreateNew(str(folder / "stage.usda"))
    above, volume = UsdGeom.Xform.Define(stage, "/Up"), stage.DefinePrim("/Up/Smoke", "Volume")
    field = stage.DefinePrim("/Up/Smoke/Between/Field", "OpenVDBAsset")
    above.AddRotateXYZOp().Set(turn)
    UsdGeom.Xformable(volume).AddTranslateOp().Set(move)
    own = UsdGeom.Xformable(field)
    own.AddScaleOp().Set(tuple(x + 4 for x in stretch))
    own.AddTranslateOp(opSuffix="second").Set(move)
    own.SetResetXformStack(resets)
    field.GetAttribute("filePath").Set("./smoke.vdb")
    field.GetAttribute("fieldName").Set("density")
    volume.CreateRelationship("field:density").AddTarget(field.GetPath())
    stage.Save()
    (medium,) = translate(Usd.Stage.Open(str(folder / "stage.usda")), RenderSettings())[0].media
    expected = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(field)).T @ np.diag([0.5, 0.5, 0.5, 1])
    np.testing.assert_allclose(medium.matrices[0], expected, rtol=1e-12, atol=1e-12)


def test_native_and_point_instances(tmp_path: Path) -> None:
    write(tmp_path, grid())
    up = 'double3 xformOp:translate = (0, 0, 5)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    text = f"""
class "Cloud" {{ {volume_text({"density": up})} }}
def "A" (instanceable = true
    references = </Cloud>) {{}}
def Xform "B" (instanceable = true
    references = </Cloud>) {{
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def PointInstancer "Many" {{
    rel prototypes = </Many/One>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 1, 0), (0, 2, 0), (0, 3, 0)]
    def Xform "One" (instanceable = true
        references = </Cloud>) {{}}
}}"""
    description, told, _ = translated(tmp_path, text)
    places = sorted(tuple(m[:3, 3].tolist()) for medium in description.media for m in medium.matrices)
    assert places == [(0, 0, 5), (0, 1, 5), (0, 2, 5), (0, 3, 5), (10, 0, 5)]
    assert len({id(medium.grid) for medium in description.media}) == 1
    assert {code for code, _ in told} == {"volume-convention"}


@pytest.mark.parametrize("hidden", ['token visibility = "invisible"', 'uniform token purpose = "proxy"'])
def test_what_is_not_drawn(tmp_path: Path, hidden: str) -> None:
    write(tmp_path, grid())
    description, told, _ = translated(tmp_path, volume_text(extra=hidden))
    assert not description.media
    assert told == []


@pytest.mark.conforms("VolumeFieldAsset.filePath")
def test_the_file_of_the_frame(tmp_path: Path) -> None:
    for k in (1, 2):
        write(tmp_path, grid(float(k)), name=f"smoke.{k}.vdb")
    samples = "asset filePath.timeSamples = { 1: @./smoke.1.vdb@, 2: @./smoke.2.vdb@ }"
    text = volume_text().replace("asset filePath = @./smoke.vdb@", samples)
    for k in (1, 2):
        (medium,) = translated(tmp_path, text, RenderSettings(time_code=float(k)))[0].media
        assert medium.grid.leaf_values[0, 0] == k


@pytest.mark.conforms("VolumeFieldAsset.fieldName", "VolumeFieldAsset.fieldIndex")
def test_the_grid_of_a_name_by_its_index(tmp_path: Path) -> None:
    write(tmp_path, grid(1.0), grid(2.0), grid(3.0))
    (medium,) = translated(tmp_path, volume_text({"density": "int fieldIndex = 2"}))[0].media
    assert medium.grid.leaf_values[0, 0] == 3


def test_a_file_is_read_once(tmp_path: Path) -> None:
    write(tmp_path, grid(0.5))
    first = translated(tmp_path, volume_text())[0]
    assert translated(tmp_path, volume_text())[0].media[0].grid is first.media[0].grid
    write(tmp_path, grid(0.25, name="density"), grid(1.0, name="other"))
    assert translated(tmp_path, volume_text())[0].media[0].grid.leaf_values[0, 0] == 0.25


FIELD = "/Smoke/density"


NO_FIELD = [("volume-field", FIELD)]
NO_FILE = [("asset-missing", FIELD)]


@pytest.mark.parametrize(
    ("text", "told", "says"),
    [
        ('def Volume "Smoke" {}', [("volume-field", "/Smoke")], "It names no field"),
        ('def Volume "Smoke" {\n rel field:density = </Gone>\n}', [("volume-field", "/Smoke")], "/Gone does not exist"),
        (volume_text().replace("OpenVDBAsset", "Field3DAsset"), NO_FIELD, "a Field3DAsset"),
        (volume_text().replace("smoke.vdb", "gone.vdb"), NO_FILE, "gone.vdb cannot be found"),
        (volume_text().replace("smoke.vdb", "smoke.####.vdb"), NO_FILE, "is a time sample of filePath"),
        (
            volume_text().replace('fieldName = "density"', 'fieldName = "dens"'),
            NO_FIELD,
            "it has no grid 'dens'; did you mean density? The field",
        ),
        (volume_text({"density": "int fieldIndex = 4"}), NO_FIELD, "no grid 'density' with index 4"),
        (
            volume_text({"density": 'token fieldDataType = "float3"'}),
            [("volume-values", FIELD), CONVENTION],
            "fieldDataType is float3",
        ),
    ],
)
def test_faults_of_fields(tmp_path: Path, text: str, told: list[tuple[str, str]], says: str) -> None:
    write(tmp_path, grid())
    _, found, messages = translated(tmp_path, text)
    assert found == told
    assert any(says in message for message in messages), messages
    assert not any(".." in message.replace("./", "") for message in messages)


def test_values_that_are_no_densities(tmp_path: Path) -> None:
    values = np.ones(512)
    values[:4] = (-1, np.nan, np.inf, 3)
    write(tmp_path, grid(values, background=7.0))
    description, told, messages = translated(tmp_path, volume_text())
    (medium,) = description.media
    np.testing.assert_array_equal(medium.grid.leaf_values[0, :5], [0, 0, 0, 3, 1])
    assert medium.grid.background == 0
    assert told == [("volume-values", FIELD), ("volume-values", FIELD), CONVENTION]
    assert messages[:2] == [
        "1 value is negative and 2 values are not finite: they are read as 0.",
        "Its background is 7: it is read as 0.",
    ]


@pytest.mark.conforms("OpenVDBAsset.fieldClass", "OpenVDBAsset.fieldDataType", "VolumeFieldAsset.fieldDataType")
def test_what_a_field_says_of_its_grid_is_compared(tmp_path: Path) -> None:
    write(tmp_path, grid())
    extra = 'token fieldDataType = "double"\ntoken fieldClass = "levelSet"'
    _, told, messages = translated(tmp_path, volume_text({"density": extra}))
    assert told == [("volume-values", FIELD), ("volume-values", FIELD), CONVENTION]
    assert "fieldDataType is double" in messages[0]
    assert "fieldClass is levelSet" in messages[1]


@pytest.mark.conforms("VolumeFieldAsset.vectorDataRoleHint", "Field3DAsset.fieldPurpose", state="no effect")
def test_hints_have_no_effect(tmp_path: Path) -> None:
    write(tmp_path, grid())
    extra = 'token vectorDataRoleHint = "Color"\ntoken fieldPurpose = "density"'
    description, told, _ = translated(tmp_path, volume_text({"density": extra}))
    assert len(description.media) == 1
    assert told == [CONVENTION]


@pytest.mark.conforms("Field3DAsset.fieldDataType", state="not rendered")
def test_field3d_is_reported(tmp_path: Path) -> None:
    _, told, _ = translated(tmp_path, volume_text().replace("OpenVDBAsset", "Field3DAsset"))
    assert told == NO_FIELD


def test_a_level_set_is_read_as_it_is(tmp_path: Path) -> None:
    values = np.linspace(-1, 1, 512)
    write(tmp_path, grid(values, metadata={"class": vdb.string("level set")}))
    description, told, messages = translated(tmp_path, volume_text())
    np.testing.assert_array_equal(description.media[0].grid.leaf_values[0], np.maximum(values, 0).astype(np.float32))
    assert told[0] == ("volume-values", FIELD)
    assert "level set" in messages[0]
    assert "sdfToFogVolume" in messages[0]


def test_too_many_voxels(tmp_path: Path) -> None:
    write(tmp_path, grid(np.arange(512.0)))
    _, told, messages = translated(tmp_path, volume_text(), RenderSettings(max_memory_bytes=1000))
    assert told == [("volume-too-large", FIELD)]
    assert "512 voxels" in messages[0]


def test_the_automatic_camera_frames_it(tmp_path: Path) -> None:
    write(tmp_path, grid(transform=("AffineMap", np.diag([1.0, 1, 1, 1]) + np.array([[0] * 4] * 3 + [[100, 0, 0, 0]]))))
    camera = translated(tmp_path, volume_text())[0].camera
    forward = -camera.world_from_camera[:3, 2]
    to_middle = np.array([103.5, 3.5, 3.5]) - camera.world_from_camera[:3, 3]
    assert forward @ to_middle / np.linalg.norm(to_middle) > 0.99


def test_packages_have_their_files(tmp_path: Path) -> None:
    from primray.usd.inspect.dependencies import dependencies, write_usdz

    write(tmp_path, grid(3.0))
    translated(tmp_path, volume_text())
    assert str(tmp_path / "smoke.vdb") in dependencies(str(tmp_path / "stage.usda")).files
    package = str(tmp_path / "packed.usdz")
    write_usdz(str(tmp_path / "stage.usda"), package)
    (medium,) = translate(Usd.Stage.Open(package), RenderSettings())[0].media
    assert medium.grid.leaf_values[0, 0] == 3


def test_stages_without_volumes_load_no_reader() -> None:
    code = """
import sys
from pxr import Usd
from primray.settings import RenderSettings
from primray.usd import translate
stage = Usd.Stage.CreateInMemory()
stage.DefinePrim("/A", "Sphere")
translate(stage, RenderSettings())
print([name for name in sys.modules if "volumes" in name and name.startswith("primray")])
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "['primray.description.volumes']"


def test_a_field_that_cannot_be_read_is_reported_once(tmp_path: Path) -> None:
    """The shader that reads it is not reported for its absence."""
    write(tmp_path, grid(name="temperature"))
    text = volume_text({"density": "", "temperature": ""}, bound="/Look")
    shader = 'def Shader "v" { uniform token info:id = "arnold:standard_volume"\ntoken outputs:out\n}\n'
    look = f'def Material "Look" {{\ntoken outputs:arnold:volume.connect = </Look/v.outputs:out>\n{shader}}}\n'
    _, told, messages = translated(tmp_path, text + look)
    assert [of for of in told if of[0] in ("volume-field", "material-input")] == [("volume-field", FIELD)], messages


def test_fields_that_nothing_reads_are_not_reported(tmp_path: Path) -> None:
    """Signs of velocities, of fields that only other shaders read, and their types concern no picture."""
    signed = np.linspace(-1, 1, 512)
    write(tmp_path, grid(), grid(signed, name="curl"), grid((1.0, -1.0, 0.0), name="vel", kind="vec3s"))
    fields = {"density": "", "curl": 'token fieldDataType = "float3"', "vel": ""}
    assert translated(tmp_path, volume_text(fields))[1] == [CONVENTION]
    write(tmp_path, grid(signed), grid(), grid((1.0, -1.0, 0.0), name="vel", kind="vec3s"))
    assert ("volume-values", FIELD) in translated(tmp_path, volume_text({"density": "", "vel": ""}))[1]


def test_an_empty_grid_is_reported(tmp_path: Path) -> None:
    write(tmp_path, grid(0.0), grid(0.0, name="curl"))
    _, told, messages = translated(tmp_path, volume_text({"density": "", "curl": ""}))
    assert told == [("volume-empty", FIELD), CONVENTION]
    assert "The grid 'density' is 0 everywhere" in messages[0]
    write(tmp_path, vdb.Grid(name="density", leaves={}))
    assert translated(tmp_path, volume_text())[1] == [("volume-empty", FIELD), CONVENTION]
