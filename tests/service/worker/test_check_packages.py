"""Which layer a package's root is, what its files are called, and what is wrong with a usdz: told with the member's name."""

from __future__ import annotations

import struct
import zipfile
import zlib
from io import BytesIO
from pathlib import Path

import pytest
from tests.service.worker.checking import SPHERE, Checked, Files, check, check_many, run, usda, usdz, write

SHADER = 'def Shader "a" {\n  asset inputs:file = @PATH@\n}\n'


def plain_zip(members: Files, compression: int = zipfile.ZIP_STORED) -> bytes:
    """As zip tools make them: not aligned."""
    made = BytesIO()
    with zipfile.ZipFile(made, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return made.getvalue()


def aligned_zip(members: list[tuple[str, bytes]], *, flags: int = 0, method: int = 0) -> bytes:
    """A usdz by hand, whose names may be what USD's writer would not write."""
    data, directory = b"", b""
    for name, content in members:
        raw = name.encode()
        padding = -(len(data) + 30 + len(raw)) % 64
        extra = struct.pack("<HH", 0x1986, padding - 4) + bytes(padding - 4) if padding >= 4 else b""
        if not extra and padding:
            extra = struct.pack("<HH", 0x1986, padding + 60) + bytes(padding + 60)
        common = struct.pack(
            "<HHHHIIIHH", flags, method, 0, 0x21, zlib.crc32(content), len(content), len(content), len(raw), len(extra)
        )
        directory += (
            b"PK\x01\x02" + struct.pack("<HH", 20, 20) + common + struct.pack("<HHHII", 0, 0, 0, 0, len(data)) + raw + extra
        )
        data += b"PK\x03\x04" + struct.pack("<H", 20) + common + raw + extra + content
    end = struct.pack("<HHHHIIH", 0, 0, len(members), len(members), len(directory), len(data), 0)
    return data + directory + b"PK\x05\x06" + end


ROOT = usda(SPHERE).encode()
BROKEN: dict[str, tuple[bytes, str]] = {
    "deflated": (plain_zip({"a.usda": ROOT * 9}, zipfile.ZIP_DEFLATED), "a.usda"),
    "not aligned": (plain_zip({"a.usda": ROOT}), "a.usda"),
    "first member is no layer": (aligned_zip([("a.png", b"x"), ("b.usda", ROOT)]), "a.png"),
    "absolute": (aligned_zip([("/etc/a.usda", ROOT)]), "/etc/a.usda"),
    "up": (aligned_zip([("a.usda", ROOT), ("../b.usda", ROOT)]), "../b.usda"),
    "twice": (aligned_zip([("a.usda", ROOT), ("a.usda", ROOT)]), "a.usda"),
    "by case": (aligned_zip([("a.usda", ROOT), ("A.usda", ROOT)]), "A.usda"),
    "encrypted": (aligned_zip([("a.usda", ROOT)], flags=1), "a.usda"),
    "backslash": (aligned_zip([("a.usda", ROOT), ("b\\c.usda", ROOT)]), "b\\c.usda"),
}


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Checked]:
    scenes: dict[str, Files] = {f"alone {n}": {"scene.usdz": data} for n, (data, _) in enumerate(BROKEN.values())}
    scenes |= {f"among {n}": {"shot.usda": usda(SPHERE), "part.usdz": data} for n, (data, _) in enumerate(BROKEN.values())}
    return check_many(tmp_path_factory.mktemp("slot"), scenes)


@pytest.mark.parametrize("place", ["alone", "among"])
@pytest.mark.parametrize("name", BROKEN)
def test_usdz_that_are_refused(name: str, place: str, broken: dict[str, Checked]) -> None:
    problem = broken[f"{place} {list(BROKEN).index(name)}"].problem
    assert problem is not None
    assert problem["type"] == "/problems/package-unsafe"
    member = BROKEN[name][1]
    assert problem["member"] == (member if place == "alone" else f"part.usdz[{member}]")


def test_the_writer_of_these_tests_makes_good_ones(tmp_path: Path) -> None:
    found = check(tmp_path / "slot", {"scene.usdz": aligned_zip([("a.usda", ROOT), ("b.png", b"x")])})
    assert found.facts is not None
    assert [file["name"] for file in found.facts["files"]] == ["scene.usdz", "scene.usdz[a.usda]", "scene.usdz[b.png]"]
    assert found.facts["prim_types"] == {"Sphere": 1}


def test_packages_in_packages(tmp_path: Path) -> None:
    inner = usdz(tmp_path / "inner.usdz", {"in.usda": usda(SPHERE)})
    middle = usdz(tmp_path / "middle.usdz", {"m.usda": usda(SPHERE, "subLayers = [@inner.usdz@]"), "inner.usdz": inner})
    outer = usdz(tmp_path / "outer.usdz", {"o.usda": usda(SPHERE), "middle.usdz": middle})
    bad = usdz(tmp_path / "bad.usdz", {"x.usda": usda(SHADER.replace("PATH", "/etc/passwd"))})
    scenes: dict[str, Files] = {
        "two deep": {"scene.usdz": middle},
        "three deep": {"scene.usdz": outer},
        "one of a package": {"shot.usda": usda('def "a" (references = @p.usdz[in.usda]@</ball>) {\n}\n'), "p.usdz": inner},
        "named as a whole": {"shot.usda": usda(SPHERE, "subLayers = [@p.usdz@]"), "p.usdz": inner},
        "outside by a member": {"shot.usda": usda(SPHERE, "subLayers = [@p.usdz[../y.usda]@]"), "p.usdz": inner},
        "outside by a missing package's": {"shot.usda": usda(SPHERE, "subLayers = [@q.usdz[/y.usda]@]")},
        "outside from within": {"shot.usda": usda(SPHERE), "p.usdz": bad},
        "missing member": {"shot.usda": usda(SPHERE, "subLayers = [@p.usdz[no.usda]@]"), "p.usdz": inner},
    }
    found = check_many(tmp_path / "slot", {str(n): files for n, files in enumerate(scenes.values())})
    of = {name: found[str(n)] for n, name in enumerate(scenes)}
    for name in ("two deep", "one of a package", "named as a whole"):
        assert of[name].problem is None, name
        assert of[name].warnings == [], name
    three = of["three deep"].problem
    assert three is not None
    assert (three["type"], three["member"]) == ("/problems/package-unsafe", "scene.usdz[middle.usdz[inner.usdz]]")
    for name, path in (("outside by a member", "p.usdz[../y.usda]"), ("outside by a missing package's", "q.usdz[/y.usda]")):
        problem = of[name].problem
        assert problem is not None, name
        assert (problem["type"], problem["member"]) == ("/problems/package-unsafe", path)
    within = of["outside from within"].problem
    assert within is not None
    assert (within["type"], within["layer"]) == ("/problems/asset-path-outside-job", "p.usdz[x.usda]")
    assert of["missing member"].codes() == ["composition-error"]


def test_the_root_of_a_package(tmp_path: Path) -> None:
    other = usda('def Cube "box" {\n}\n')
    scenes: dict[str, Files] = {
        "only one": {"a.usda": usda(SPHERE), "x.png": b"x"},
        "the one that names others": {"shot.usda": usda(SPHERE, "subLayers = [@./model.usda@]"), "model.usda": other},
        "in a folder": {"scene/shot.usda": usda(SPHERE), "scene/parts/p.usda": other},
        "two": {"a.usda": usda(SPHERE), "b.usda": other},
        "in a circle": {"a.usda": usda(SPHERE, "subLayers = [@b.usda@]"), "b.usda": usda(SPHERE, "subLayers = [@a.usda@]")},
        "left over by macOS": {"a.usda": usda(SPHERE), "__MACOSX/._a.usda": b"\0\5\x16\7", "._a.usda": b"\0\5\x16\7"},
        "a usdz": {"a.usdz": usdz(tmp_path / "a.usdz", {"in.usda": usda(SPHERE)})},
        "none": {"a.png": b"x", "b.txt": b"y"},
    }
    found = check_many(tmp_path / "slot", {str(n): files for n, files in enumerate(scenes.values())})
    of = {name: found[str(n)] for n, name in enumerate(scenes)}
    roots = {name: (checked.facts or {}).get("entry") for name, checked in of.items()}
    assert roots == {
        "only one": "a.usda",
        "the one that names others": "shot.usda",
        "in a folder": "scene/shot.usda",
        "two": None,
        "in a circle": None,
        "left over by macOS": "a.usda",
        "a usdz": "a.usdz",
        "none": None,
    }
    two = of["two"]
    assert two.facts is not None
    assert two.facts["entries"] == ["a.usda", "b.usda"]
    assert two.codes() == ["ambiguous-entry"]
    assert of["none"].slug == "not-usd"


def test_an_entry_that_is_named(tmp_path: Path) -> None:
    files: Files = {"a.usda": usda(SPHERE), "b.usda": usda('def Cube "box" {\n}\n')}
    entries = {"0": "b.usda", "1": "c.usda", "2": "../b.usda", "3": "/etc/passwd"}
    found = check_many(tmp_path / "slot", dict.fromkeys(entries, files), entries=entries)
    assert found["0"].facts is not None
    assert found["0"].facts["prim_types"] == {"Cube": 1}
    for name in ("1", "2", "3"):
        missing = found[name].problem
        assert missing is not None
        assert (missing["type"], missing["candidates"]) == ("/problems/entry-missing", ["a.usda", "b.usda"])


def test_links_in_the_job_folder_are_refused(tmp_path: Path) -> None:
    """The server unpacks none; a check does not rely on it."""
    slot = tmp_path / "slot"
    (slot / "out").mkdir(parents=True)
    write(slot / "job" / "package", {"a.usda": usda(SPHERE)})
    write(tmp_path, {"outside.usda": usda(SPHERE)})
    (slot / "job" / "package" / "b.usda").symlink_to(tmp_path / "outside.usda")
    found = run(slot, {"do": "check", "file": "package", "kind": "zip", "entry": None, "limits": {}}).problem
    assert found is not None
    assert (found["type"], found["member"]) == ("/problems/package-unsafe", "b.usda")


def test_programs_are_ignored_and_said_to_be(tmp_path: Path) -> None:
    marker = tmp_path / "slot" / "out" / "loaded"
    files: Files = {
        "shot.usda": usda(SPHERE),
        "plugInfo.json": '{"Plugins": [{"Type": "python", "Name": "evil", "Root": ".", "Info": {}}]}',
        "pxr/pluginfo/plugInfo.json": "{}",
        "evil.py": f"open({str(marker)!r}, 'w')",
        "sitecustomize.py": f"open({str(marker)!r}, 'w')",
        "lib.so": b"\x7fELF",
    }
    found = check(tmp_path / "slot", files)
    assert found.facts is not None
    assert found.codes() == ["file-ignored"] * 5
    assert not marker.exists()
