"""Every place of a layer where a file can be named: outside of what was uploaded it is refused, with the layer and the path."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from tests.service.worker.checking import SPHERE, Checked, Files, check_many, usda

from primray_service.sandbox import usable_layers

# PATH is the path.
PLACES = {
    "sublayer": usda(SPHERE, "subLayers = [@PATH@]"),
    "reference": usda('def "a" (references = @PATH@) {\n}\n' + SPHERE),
    "reference with a target": usda('def "a" (references = @PATH@</x>) {\n}\n'),
    "payload": usda('def "a" (payload = @PATH@) {\n}\n'),
    "clip": usda('def "a" (clips = { dictionary default = { asset[] assetPaths = [@PATH@]; string primPath = "/a" } }) {\n}\n'),
    "clip manifest": usda('def "a" (clips = { dictionary default = { asset manifestAssetPath = @PATH@ } }) {\n}\n'),
    "clip template": usda('def "a" (clips = { dictionary default = { string templateAssetPath = "PATH" } }) {\n}\n'),
    "texture": usda('def Shader "a" {\n  asset inputs:file = @PATH@\n}\n'),
    "array": usda('def "a" {\n  asset[] files = [@ok.png@, @PATH@]\n}\n'),
    "time samples": usda('def "a" {\n  asset file.timeSamples = { 1: @ok.png@, 2: @PATH@ }\n}\n'),
    "light profile": usda('def SphereLight "a" {\n  asset inputs:shaping:ies:file = @PATH@\n}\n'),
    "custom data": usda('def "a" (customData = { asset file = @PATH@ }) {\n}\n'),
    "layer data": usda(SPHERE, "customLayerData = { asset file = @PATH@ }"),
    "asset info": usda('def "a" (assetInfo = { asset identifier = @PATH@ }) {\n}\n'),
    "unselected variant": usda(
        'def "a" (variantSets = "v"\n variants = { string v = "x" }) {\n variantSet "v" = {\n  "x" {\n  }\n'
        '  "y" (references = @PATH@) {\n  }\n }\n}\n'
    ),
    "inactive prim": usda('def "a" (active = false\n payload = @PATH@) {\n}\n'),
}
WAYS_OUT = {
    "up": "../outside/x.usda",
    "up and over": "./tex/../../x.usda",
    "absolute": "/etc/passwd",
    "file": "file:/etc/passwd",
    "http": "http://169.254.169.254/x.usda",
    "other scheme": "s3://bucket/x.usda",
    "drive": "C:/x.usda",
    "backslashes": "..\\x.usda",
}


def scene(place: str, path: str) -> Files:
    return {"scene.usda": PLACES[place].replace("PATH", path)}


CASES = {f"{place}, up": (place, "up") for place in PLACES} | {f"reference, {way}": ("reference", way) for way in WAYS_OUT}
CASES |= {f"texture, {way}": ("texture", way) for way in WAYS_OUT}


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Checked]:
    scenes = {str(n): scene(place, WAYS_OUT[way]) for n, (place, way) in enumerate(CASES.values())}
    found = check_many(tmp_path_factory.mktemp("slot"), scenes)
    return {name: found[str(n)] for n, name in enumerate(CASES)}


@pytest.mark.parametrize("name", CASES)
def test_what_leads_out_is_refused(name: str, checked: dict[str, Checked]) -> None:
    path = WAYS_OUT[CASES[name][1]]
    problem = checked[name].problem
    assert problem is not None, checked[name].facts
    assert (problem["type"], problem["layer"], problem["asset_path"]) == (
        "/problems/asset-path-outside-job",
        "scene.usda",
        path,
    )


INSIDE: dict[str, tuple[Files, list[str]]] = {
    "up, but inside": (
        {
            "shot.usda": usda('def "a" (references = @sub/a.usda@</a>) {\n}\n'),
            "sub/a.usda": usda('def Shader "a" {\n asset inputs:file = @../shared/x.png@\n}\n' + SPHERE),
            "shared/x.png": b"x",
        },
        [],
    ),
    "search path beside the layer": (
        {"shot.usda": usda(SPHERE + 'def Shader "a" {\n asset inputs:file = @textures/a.png@\n}\n'), "textures/a.png": b"x"},
        [],
    ),
    "search path that is not beside the layer": (
        {
            "shot.usda": usda(SPHERE, "subLayers = [@sub/a.usda@]"),
            "sub/a.usda": usda('def Shader "a" {\n asset inputs:file = @textures/a.png@\n}\n'),
            "textures/a.png": b"x",
        },
        ["asset-not-uploaded"],
    ),
    "tiles": (
        {"shot.usda": usda(SPHERE + 'def Shader "a" {\n asset inputs:file = @t.<UDIM>.png@\n}\n'), "t.1002.png": b"x"},
        [],
    ),
    "tiles that are not there": (
        {"shot.usda": usda(SPHERE + 'def Shader "a" {\n asset inputs:file = @t.<UDIM>.png@\n}\n'), "t.102.png": b"x"},
        ["asset-not-uploaded"],
    ),
    "missing texture": (
        {"scene.usda": usda(SPHERE + 'def Shader "a" {\n asset inputs:file = @t.png@\n}\n')},
        ["asset-not-uploaded"],
    ),
    "missing reference": ({"scene.usda": usda(SPHERE + 'def "a" (references = @x.usda@) {\n}\n')}, ["composition-error"]),
    "missing sublayer": ({"scene.usda": usda(SPHERE, "subLayers = [@x.usda@]")}, ["composition-error"]),
    "identifier that is nothing": (
        {"scene.usda": usda(SPHERE + 'def "a" (assetInfo = { asset identifier = @a/b.usd@ }) {\n}\n')},
        [],
    ),
}


@pytest.fixture(scope="module")
def inside(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Checked]:
    found = check_many(tmp_path_factory.mktemp("slot"), {str(n): files for n, (files, _) in enumerate(INSIDE.values())})
    return {name: found[str(n)] for n, name in enumerate(INSIDE)}


@pytest.mark.parametrize("name", INSIDE)
def test_what_stays_inside_is_accepted(name: str, inside: dict[str, Checked]) -> None:
    found = inside[name]
    assert found.problem is None
    assert found.codes() == INSIDE[name][1]


def composed(variable: str) -> Files:
    """No layer by itself leads out: the variable of one is put into the expression of the other."""
    return {
        "root.usda": usda(
            'def "a" (references = @b.usda@) {\n}\n', f'defaultPrim = "a"\nexpressionVariables = {{ string X = "{variable}" }}'
        ),
        "b.usda": usda(
            'def "q" (references = @`"${X}.usda"`@) {\n}\n', 'defaultPrim = "q"\nexpressionVariables = { string X = "./ok" }'
        ),
        "ok.usda": usda('def "q" {\n}\n', 'defaultPrim = "q"'),
    }


WALLS = [frozenset({"rlimits", "landlock", "seccomp"}), frozenset({"rlimits", "bubblewrap", "seccomp"}), None]


@pytest.mark.parametrize("walls", WALLS, ids=["landlock", "bubblewrap", "all"])
def test_composed_expressions_meet_the_wall(tmp_path: Path, walls: frozenset[str] | None) -> None:
    """What no layer shows: the file outside cannot be opened, and whether it exists is not told."""
    if walls is not None and not walls <= usable_layers():
        pytest.skip(f"skipped: no {', '.join(walls - usable_layers())}")
    outside = tmp_path / "ev.usda"
    outside.write_text(usda('def Sphere "stolen" {\n}\n', 'defaultPrim = "stolen"'))
    # As seen from the package's folder, which lies in slot/job/N.
    there, gone = (check_many(tmp_path / "slot", {"0": composed(f"../../../../{name}")}, walls)["0"] for name in ("ev", "no"))
    assert there.slug == gone.slug == "asset-missing"
    assert there.problem is not None
    assert gone.problem is not None
    assert there.problem["detail"].replace("ev.usda", "no.usda") == gone.problem["detail"]
    for found in (there, gone):
        assert "stolen" not in found.everything()
        assert str(tmp_path) not in found.everything()


def test_without_walls_the_file_is_opened(tmp_path: Path) -> None:
    """Or the tests around this one would prove nothing."""
    (tmp_path / "ev.usda").write_text(usda('def "stolen" {\n def Sphere "stolen" {\n }\n}\n', 'defaultPrim = "stolen"'))
    found = check_many(tmp_path / "slot", {"0": composed("../../../../ev")}, frozenset({"rlimits"}))["0"]
    assert found.facts is not None
    assert found.facts["prim_types"] == {"Sphere": 1}


def test_literal_parts_of_expressions_are_seen(tmp_path: Path) -> None:
    scenes: dict[str, Files] = {
        "0": {"scene.usda": usda('def "a" (references = @`"../${X}.usda"`@) {\n}\n')},
        "1": {"scene.usda": usda('def "a" (references = @`"${X}/../../b.usda"`@) {\n}\n')},
        "2": {
            "scene.usda": usda('def "a" (references = @`"${X}.usda"`@) {\n}\n', 'expressionVariables = { string X = "/etc/x" }')
        },
    }
    found = check_many(tmp_path / "slot", scenes)
    assert [found[n].slug for n in scenes] == ["asset-path-outside-job"] * 3


@pytest.mark.parametrize("walls", WALLS[:2], ids=["landlock", "bubblewrap"])
def test_files_outside_are_never_opened(tmp_path: Path, walls: frozenset[str]) -> None:
    """As the kernel tells it: of every way that a scene can name a file outside, none was opened."""
    strace = shutil.which("strace")
    if strace is None or not walls <= usable_layers():
        pytest.skip("skipped: no strace, or not these walls")
    if subprocess.run([strace, "-D", "-o", "/dev/null", "true"], capture_output=True).returncode:
        pytest.skip("skipped: strace may not trace here")
    outside = tmp_path / "outside-of-it"
    outside.mkdir()
    for name in ("x.usda", "x.png", "x.usdz"):
        (outside / name).write_text(usda('def Sphere "stolen" {\n}\n', 'defaultPrim = "stolen"'))
    up = "../../../outside-of-it"  # from the folder of a single file: slot/job/N
    paths = [f"{outside}/x.usda", f"{up}/x.usda", f"file:{outside}/x.usda", f"{outside}/x.usdz[a.usda]"]
    scenes: dict[str, Files] = {
        f"{n}-{m}": {"scene.usda": PLACES[place].replace("PATH", path)}
        for n, place in enumerate(PLACES)
        for m, path in enumerate(paths)
    }
    scenes["composed"] = composed(f"../{up}/x")
    trace = tmp_path / "trace"
    options = ("-D", "-f", "-qq", "-y", "-s", "4096", "-e", "trace=openat,open,openat2,execve,connect,socket", "-o", str(trace))
    found = check_many(tmp_path / "slot", scenes, walls, (strace, *options))
    assert not [name for name, checked in found.items() if checked.facts is not None]
    lines = trace.read_text(errors="replace").splitlines()
    assert any("scene.usda" in line and " = -1 " not in line for line in lines), "the trace shows what is opened"
    opened = [line for line in lines if "outside-of-it" in line and " = -1 " not in line and "execve" not in line]
    assert opened == []
    # Only what composing brings about, and the folder of a clip template, are tried at all.
    tried = {line.split('"')[1].rpartition("/")[2] for line in lines if "outside-of-it" in line and "execve" not in line}
    assert tried <= {"x.usda", "outside-of-it"}
