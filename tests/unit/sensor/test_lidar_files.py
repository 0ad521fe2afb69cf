"""Files of scans are read back by the readers of their formats; the command writes them, and says what is wrong."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import LidarDetector, LidarPattern, LidarScan
from primray.cli import run
from primray.errors import SettingsError
from primray.sensor.lidar_files import las_class

STAGE = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "ground" (
    prepend apiSchemas = ["SemanticsLabelsAPI:class"]
)
{
    token[] semantics:labels:class = ["road"]
    def Mesh "plane"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-5000, -5000, 0), (5000, -5000, 0), (5000, 5000, 0), (-5000, 5000, 0)]
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
    }
}
def Xform "lidar"
{
    int primray:lidar:channels = 4
    float2 primray:lidar:elevationRange = (-30, 3)
    int primray:lidar:steps = 90
    double3 xformOp:translate = (100, 200, 150)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("lidar") / "stage.usda"
    path.write_text(STAGE)
    return str(path)


@pytest.fixture(scope="module")
def scan(stage: str) -> LidarScan:
    return primray.lidar(stage)


def test_an_array_has_all_fields(scan: LidarScan, tmp_path: Path) -> None:
    found = np.load(scan.save(tmp_path / "a.npy"))
    assert found.tobytes() == scan.points.tobytes()
    assert len(found) == 270  # 3 of 4 channels look down
    world = np.load(scan.save(tmp_path / "b.npy", axes="world"))
    assert np.abs(world["z"]).max() < 1e-5
    assert np.abs(world["x"] - found["x"] - 1).max() < 1e-6


def test_a_pcd_is_read_by_pypcd4(scan: LidarScan, tmp_path: Path) -> None:
    pypcd4 = pytest.importorskip("pypcd4", reason="skipped: no pypcd4")
    for axes, precision in (("sensor", np.float32), ("world", np.float64)):
        cloud: Any = pypcd4.PointCloud.from_path(scan.save(tmp_path / f"{axes}.pcd", axes))
        assert cloud.points == len(scan.points)
        assert cloud.fields[:5] == ("x", "y", "z", "intensity", "ring")
        assert np.array_equal(cloud.numpy(("x", "y", "z")), scan.positions(axes).astype(precision))
        assert np.array_equal(cloud.numpy(("object_id",)).ravel().astype(np.uint32), scan.points["object_id"])
        assert np.array_equal(cloud.numpy(("time",)).ravel(), scan.points["time"])


def test_a_las_is_read_by_laspy(scan: LidarScan, tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="skipped: no laspy")
    path = scan.save(tmp_path / "a.las", "world")
    las: Any = laspy.read(path)
    assert (str(las.header.version), las.header.point_format.id) == ("1.4", 6)
    assert las.header.creation_date == datetime.date(2000, 1, 1)  # the same bytes tomorrow
    assert np.abs(np.stack([las.x, las.y, las.z], axis=1) - scan.positions("world")).max() < 0.51e-4
    assert np.array_equal(las.intensity, np.rint(scan.points["intensity"].astype(np.float64) * 65535))
    assert np.array_equal(las.gps_time, scan.points["time"])
    assert np.array_equal(las.return_number, scan.points["return_number"])
    assert np.array_equal(las.number_of_returns, scan.points["number_of_returns"])
    assert set(las.classification) == {64}
    assert np.array_equal(las.object_id, scan.points["object_id"])
    assert np.array_equal(las.range, scan.points["range"])
    assert scan.save(tmp_path / "b.las", "world").read_bytes() == path.read_bytes()


def test_las_coordinates_fit_however_large_the_world(stage: str, tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="skipped: no laspy")
    far = np.eye(4)
    far[:3, 3] = (1e12, 0, 100)
    wide = LidarPattern.rotating([-30], steps=8)
    scan = primray.lidar(stage, far, wide)
    assert len(scan.points) == 0  # the plane is elsewhere
    las: Any = laspy.read(scan.save(tmp_path / "none.las", "world"))
    assert len(las.points) == 0


def test_classes_of_las_are_those_that_users_define() -> None:
    assert las_class(np.array([0, 1, 192, 193, 70000], np.uint32)).tolist() == [0, 64, 255, 0, 0]


def test_las_without_laspy_is_an_error(scan: LidarScan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "laspy", None)
    with pytest.raises(SettingsError, match=r"pip install primray\[lidar\]") as caught:
        scan.save(tmp_path / "a.las")
    assert caught.value.code == "lidar-laspy"
    assert not list(tmp_path.iterdir())


def test_the_command_writes_and_tells(stage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = tmp_path / "scan.json"
    assert run(["lidar", stage, "-o", str(tmp_path / "a.npy"), "-o", str(tmp_path / "a.pcd"), "--report", str(report)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "360 firings in 98.89 ms, 270 points"
    assert printed[1] == "90 firings (25.0%) without a return from 0.3 to 200 m"
    assert printed[-1] == "100.0% of the points are labelled: road"
    says = json.loads(report.read_text())
    assert (says["sensor"], says["firings"], says["misses"], says["points"]) == ("/lidar", 360, 90, 270)
    assert says["parts"] == [{"prim": "/ground/plane", "instance": ""}]
    assert says["classes"] == {"1": "road"}
    assert LidarPattern.of(says["pattern"]).steps == 90
    assert len(np.load(tmp_path / "a.npy")) == 270
    assert run(["lidar", stage, "--pattern", "vlp-16", "--range-noise", "0.02", "--sensor", "lidar", "-j", "1"]) == 0
    assert capsys.readouterr().out.startswith("28,928 firings")


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        (["-o", "a.ply"], "a scan is written as .npy, .pcd, .las, not .ply"),
        (["-o", "no/a.npy"], "the folder no does not exist"),
        (["-o", "a.npy", "-o", "./a.npy"], "an output is named twice"),
        (["--returns", "16"], "1 to 15 returns"),
        (["--which", "lats"], "did you mean last"),
        (["--weights", "1", "1", "0"], "their sum is 1"),
        (["--range-noise", "-1"], "range_noise_m must be 0 or more"),
        (["--reference-range", "0"], "must be above 0"),
        (["--axes", "wrld"], "did you mean world"),
        (["--pattern", "rotating-23"], "no pattern is named 'rotating-23'"),
        (["--pattern", "no.csv"], "there is no such file"),
        (["--sensor", "/lidars"], "there is no prim '/lidars'; did you mean /lidar"),
        (["--sensor", "/ground/plane/no"], "there is no prim"),
        (["--frames", "1:3"], "lidar accepts only one frame"),
    ],
)
def test_bad_flags_are_errors(
    stage: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    flags: list[str],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["lidar", stage, *flags]) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())


def test_noise_is_normal_and_a_function_of_seed_and_firing(stage: str) -> None:
    pattern = LidarPattern.rotating(np.linspace(-60, -20, 64).tolist(), steps=360)
    ideal = primray.lidar(stage, "/lidar", pattern).points
    noisy = primray.lidar(stage, "/lidar", pattern, detector=LidarDetector(range_noise_m=0.02, seed=5)).points
    error = noisy["range"] - ideal["range"]
    assert len(error) == 23040
    assert abs(error.mean()) < 4.5 * 0.02 / np.sqrt(len(error))
    assert error.std() == pytest.approx(0.02, rel=4.5 / np.sqrt(2 * len(error)))
    half = primray.lidar(
        stage,
        "/lidar",
        LidarPattern.rotating(np.linspace(-60, -20, 64).tolist(), steps=360, range_m=(0.3, 3)),
        detector=LidarDetector(range_noise_m=0.02, seed=5),
    ).points
    assert 0 < len(half) < len(noisy)
    assert np.array_equal(half["range"], noisy["range"][np.isin(noisy["firing"], half["firing"])])
    other = primray.lidar(stage, "/lidar", pattern, detector=LidarDetector(range_noise_m=0.02, seed=6)).points
    assert not np.array_equal(other["range"], noisy["range"])
