"""Layers made to crash, to hang, to grow or to make USD quote what it read: each ends as the threat table says."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest
from pxr import Sdf, Usd
from tests.service.worker.checking import CRASHES, SPHERE, Files, check, check_many, run, usda, write


def bomb(levels: int, metadata: str = "") -> str:
    """Each level refers ten times to the next."""
    text = ""
    for level in range(levels):
        prims = "".join(f'  def "p{n}" ({metadata}references = </l{level + 1}>) {{\n  }}\n' for n in range(10))
        text += f'def "l{level}" {{\n{prims}}}\n'
    return usda(text + f'def "l{levels}" {{\n  def Sphere "s" {{\n  }}\n}}\n')


def layered_bomb(levels: int) -> Files:
    """The same over files, through payloads."""
    files: Files = {}
    for level in range(levels):
        prims = "".join(f'  def "p{n}" (payload = @l{level + 1}.usda@) {{\n  }}\n' for n in range(10))
        files[f"l{level}.usda" if level else "scene.usda"] = usda(f'def "a" {{\n{prims}}}\n', 'defaultPrim = "a"')
    return {**files, f"l{levels}.usda": usda(SPHERE, 'defaultPrim = "ball"')}


@pytest.mark.parametrize(
    ("files", "what"),
    [
        ({"scene.usda": bomb(9)}, "prims"),
        ({"scene.usda": bomb(9, "instanceable = true\n    ")}, "prims of instances"),
        (layered_bomb(9), "prims"),
    ],
    ids=["references", "instances", "files"],
)
def test_reference_bombs_are_counted_not_composed(tmp_path: Path, files: Files, what: str) -> None:
    found = check(tmp_path / "slot", files, cpu_s=10)
    assert found.problem is not None
    assert found.slug == "scene-too-large"
    assert found.problem["count"] > 1e9
    assert f" {what};" in found.problem["detail"]
    assert found.seconds < 60  # all of it would take days


def test_smaller_ones_are_not_refused(tmp_path: Path) -> None:
    """Ten thousand spheres by references, and a thousand million by instances if that many are allowed."""
    assert check(tmp_path / "slot", {"scene.usda": bomb(3)}).problem is None
    found = check(tmp_path / "slot", {"scene.usda": bomb(9, "instanceable = true\n    ")}, instances=10**12)
    assert found.problem is None


def test_what_no_count_sees_ends_by_its_cpu_seconds(tmp_path: Path) -> None:
    """A template's clips are named one by one: a thousand million of them."""
    clips = (
        'string templateAssetPath = "./c.###.usda"; double templateStartTime = 1; double templateEndTime = 1e9; '
        'double templateStride = 1e-7; string primPath = "/a"'
    )
    scene = usda(f'def "a" (clips = {{ dictionary default = {{ {clips} }} }}) {{\n}}\n')
    began = time.monotonic()
    found = check(tmp_path / "slot", {"scene.usda": scene}, cpu_s=0.5)
    assert (found.problem, found.facts, found.signal) == (None, None, signal.SIGXCPU)
    assert time.monotonic() - began < 300  # where others use the processors too; all of it would take days


NESTED = {
    "dictionaries": lambda n: usda(SPHERE, "customLayerData = " + "{ dictionary a = " * n + "{" + "}" * (n + 1)),
    "arrays": lambda n: usda(f'def "a" {{\n  int[] b = {"[" * n}{"]" * n}\n}}\n'),
    "prims": lambda n: usda('def "a" {\n' * n + "}\n" * n),
    "variants": lambda n: usda('def "a" {\n' + 'variantSet "v" = {\n"x" {\n' * n + "}\n}\n" * n + "}\n"),
    "hidden behind a string": lambda n: usda(
        'def "a" {\n  string s = "' + "}" * n + '"\n' + 'def "b" {\n' * n + "}\n" * n + "}\n"
    ),
    "hidden behind a comment": lambda n: usda("# " + "}" * n + "\n" + 'def "b" {\n' * n + "}\n" * n),
    "hidden behind a path": lambda n: usda(
        'def "a" {\n  asset s = @' + "}" * n + "@\n" + 'def "b" {\n' * n + "}\n" * n + "}\n"
    ),
}


def test_deep_nesting_never_reaches_the_parser(tmp_path: Path) -> None:
    deep: dict[str, Files] = {str(n): {"scene.usda": make(50_000)} for n, make in enumerate(NESTED.values())}
    found = check_many(tmp_path / "slot", deep)
    assert {name: checked.slug for name, checked in found.items()} == dict.fromkeys(deep, "scene-too-large")
    problem = found["0"].problem
    assert problem is not None
    assert (problem["layer"], problem["limit"]) == ("scene.usda", 1000)


def test_a_parser_that_crashes_takes_only_its_process_with_it(tmp_path: Path) -> None:
    """As it would where the limit is set too high, or by something that is not counted."""
    found = check(tmp_path / "slot", {"scene.usda": NESTED["dictionaries"](60_000)}, prim_depth=10**6)
    assert (found.problem, found.facts) == (None, None)
    assert found.signal in CRASHES


def test_nesting_within_the_limit_is_read(tmp_path: Path) -> None:
    brackets = "(" * 5000 + "[" * 5000
    scenes: dict[str, Files] = {
        "0": {"scene.usda": NESTED["prims"](900)},
        "1": {"scene.usda": usda(f'def Sphere "a" {{\n  string s = "{brackets}"\n}} # {brackets}\n')},
        "2": {"scene.usda": usda(f'def Sphere "a" (doc = """{brackets}""") {{\n}}\n')},
    }
    found = check_many(tmp_path / "slot", scenes)
    assert [checked.problem for checked in found.values()] == [None, None, None]


def test_deep_binary_layers_are_refused_after_reading(tmp_path: Path) -> None:
    path = tmp_path / "deep.usdc"
    layer = Sdf.Layer.CreateNew(str(path))
    Sdf.CreatePrimInLayer(layer, "/" + "/".join("a" for _ in range(1500)))
    layer.Save()
    found = check(tmp_path / "slot", {"scene.usdc": path.read_bytes()})
    assert (found.slug, (found.problem or {})["count"]) == ("scene-too-large", 1500)


UNREADABLE: dict[str, tuple[bytes, int | None]] = {
    "syntax": (b'#usda 1.0\ndef "a" {\n  string x = 3 of\n}\n', 3),
    "not closed": (b'#usda 1.0\ndef "a" {\n', 3),
    "not text": (b'#usda 1.0\ndef "a" {\n  string x = 3 of \xff\xfe\n}\n', 3),
    "name not text": (b'#usda 1.0\ndef "a\xff" {\n}\n', 2),
}


def test_syntax_errors_are_told_in_usds_own_words(tmp_path: Path) -> None:
    scenes: dict[str, Files] = {str(n): {"scene.usda": text} for n, (text, _) in enumerate(UNREADABLE.values())}
    found = check_many(tmp_path / "slot", scenes)
    for n, (name, (_, line)) in enumerate(UNREADABLE.items()):
        problem = found[str(n)].problem
        assert problem is not None, name
        assert (problem["type"], problem["layer"], problem["line"]) == ("/problems/layer-unreadable", "scene.usda", line), name
        assert problem["detail"].startswith(f"USD cannot open it: scene.usda:{line}:{problem['column']}: "), name
        assert str(tmp_path) not in found[str(n)].everything(), name


def test_a_layer_that_cannot_be_read_refuses_no_stage_that_goes_on_without_it(tmp_path: Path) -> None:
    """As the command line goes on, which says why at the prim, in the same words."""
    broken = UNREADABLE["syntax"][0]
    scenes: dict[str, Files] = {
        "sublayer": {"root.usda": usda(SPHERE, "subLayers = [@sub/bad.usda@]"), "sub/bad.usda": broken},
        "reference": {"root.usda": usda(SPHERE + 'def "b" (references = @bad.usda@) {\n}\n'), "bad.usda": broken},
        "nobody's": {"root.usda": usda(SPHERE), "bad.usda": broken},
        "no layer": {"root.usda": usda(SPHERE, "subLayers = [@bad.usda@]"), "bad.usda": b"hello"},
        "asked for": {"root.usda": usda(SPHERE), "bad.usda": broken},
    }
    found = check_many(tmp_path / "slot", scenes, entries={"asked for": "bad.usda"})
    of = {name: [(w["severity"], w["code"], w["prim"]) for w in checked.warnings] for name, checked in found.items()}
    assert of["sublayer"] == of["no layer"] == [("error", "composition-error", "/")]
    assert of["reference"] == [("error", "composition-error", "/b")]
    assert of["nobody's"] == [("info", "file-ignored", "")]
    assert "sub/bad.usda:3:" in found["sublayer"].warnings[0]["detail"]
    assert "The layer 'bad.usda' is omitted. USD cannot open it: bad.usda:3:" in found["nobody's"].warnings[0]["detail"]
    assert (found["asked for"].slug, (found["asked for"].problem or {})["layer"]) == ("layer-unreadable", "bad.usda")


def test_binary_layers_that_are_broken(tmp_path: Path) -> None:
    path = tmp_path / "good.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    stage.DefinePrim("/a", "Sphere")
    stage.Save()
    good = path.read_bytes()
    scenes: dict[str, Files] = {
        "cut": {"scene.usdc": good[:60]},
        "zeros": {"scene.usdc": good[:16] + bytes(len(good) - 16)},
        "magic": {"scene.usdc": b"PXR-USDC"},
    }
    found = check_many(tmp_path / "slot", scenes)
    assert {name: checked.slug for name, checked in found.items()} == dict.fromkeys(scenes, "layer-unreadable")


def test_files_that_are_called_usd_and_are_none(tmp_path: Path) -> None:
    scenes: dict[str, Files] = {
        "alone": {"scene.usda": "hello"},
        "empty": {"scene.usd": b""},
        "other": {"scene.usda": b"PXR-USDC" + bytes(80)},
        "among": {"a.usda": usda(SPHERE), "sub/b.usda": "hello"},
    }
    found = check_many(tmp_path / "slot", scenes)
    slugs = {name: checked.slug for name, checked in found.items()}
    assert slugs == {"alone": "not-usd", "empty": "not-usd", "other": "not-usd", "among": ""}
    assert found["among"].codes() == ["file-ignored"]


def test_circles_end(tmp_path: Path) -> None:
    scenes: dict[str, Files] = {
        "sublayers": {"scene.usda": usda(SPHERE, "subLayers = [@scene.usda@]")},
        "references": {
            "a.usda": usda('def "a" (references = @b.usda@</b>) {\n}\n' + SPHERE),
            "b.usda": usda('def "b" (references = @a.usda@</a>) {\n}\n'),
        },
        "inherits": {"scene.usda": usda('def "a" (inherits = </a/b>) {\n  def "b" (references = </a>) {\n  }\n}\n' + SPHERE)},
    }
    found = check_many(tmp_path / "slot", scenes)
    assert [checked.problem for checked in found.values()] == [None] * 3


def test_too_many_layers(tmp_path: Path) -> None:
    files: Files = {f"l{n}.usda": usda(SPHERE) for n in range(30)}
    slot = tmp_path / "slot"
    (slot / "out").mkdir(parents=True)
    write(slot / "job" / "package", files)
    problem = run(slot, {"do": "check", "file": "package", "kind": "zip", "entry": None, "limits": {"layers": 29}}).problem
    assert problem is not None
    assert (problem["type"], problem["count"], problem["limit"]) == ("/problems/scene-too-large", 30, 29)
