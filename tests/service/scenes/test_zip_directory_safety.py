"""Every row of the threat table that is about zips, sent to a real server: refused, with the member's name, nothing left."""

from __future__ import annotations

import io
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.scenes.zips import LAYER, Entry, package, zip_of
from tests.service.serving import RunningServer

ENTRIES = 50
UNPACKED = 64 * 2**20


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(limits={"package_entries": ENTRIES, "unpacked_bytes": UNPACKED}, dispatch=False, warm=False)


@pytest.fixture
def post(server: RunningServer) -> Iterator[Any]:
    client = server.client()
    yield lambda body, name="scene.zip": client.post("/v1/scenes", params={"name": name}, content=body)
    client.close()


def left_over(data: Path) -> list[str]:
    return sorted(os.listdir(data / "incoming"))


LINK = stat.S_IFLNK | 0o777
UNSAFE = {
    "dots": (package(Entry("a/../../evil.png", b"x")), "a/../../evil.png"),
    "dots first": (package(Entry("../evil.png", b"x")), "../evil.png"),
    "dot": (package(Entry("a/./b.png", b"x")), "a/./b.png"),
    "empty part": (package(Entry("a//b.png", b"x")), "a//b.png"),
    "absolute": (package(Entry("/etc/cron.d/x", b"x")), "/etc/cron.d/x"),
    "drive": (package(Entry("C:/x.png", b"x")), "C:/x.png"),
    "drive relative": (package(Entry("C:x.png", b"x")), "C:x.png"),
    "backslash": (package(Entry("..\\evil.png", b"x")), "..\\evil.png"),
    "NUL": (package(Entry("a.png\0.txt", b"x")), "a.png\\x00.txt"),
    "newline": (package(Entry("a\nb.png", b"x")), "a\\nb.png"),
    "right to left": (package(Entry("a\u202egnp.exe", b"x")), "a\\u202egnp.exe"),
    "device name": (package(Entry("tex/CON.png", b"x")), "tex/CON.png"),
    "stream": (package(Entry("a.png:hidden", b"x")), "a.png:hidden"),
    "trailing dot": (package(Entry("a.", b"x")), "a."),
    "symlink": (package(Entry("link.png", b"/etc/passwd", mode=LINK)), "link.png"),
    "symlink folder": (package(Entry("dir", b"/etc", mode=LINK), Entry("dir/passwd", b"x")), "dir"),
    "device": (package(Entry("zero.png", b"", mode=stat.S_IFCHR | 0o666)), "zero.png"),
    "block device": (package(Entry("sda.png", b"", mode=stat.S_IFBLK | 0o666)), "sda.png"),
    "pipe": (package(Entry("pipe.png", b"", mode=stat.S_IFIFO | 0o666)), "pipe.png"),
    "socket": (package(Entry("sock.png", b"", mode=stat.S_IFSOCK | 0o666)), "sock.png"),
    "symlink said by no Unix": (package(Entry("link.png", b"/etc/passwd", mode=LINK, made_by=0)), "link.png"),
    "folder that is a file": (package(Entry("tex/", b"", mode=stat.S_IFREG | 0o644)), "tex/"),
    "folder with content": (package(Entry("tex/", b"abc", mode=stat.S_IFDIR | 0o755)), "tex/"),
    "deflated folder with content": (package(Entry("tex/", b"abc", True, size=0, crc=0, mode=stat.S_IFDIR | 0o755)), "tex/"),
    "deflated folder that is cut off": (package(Entry("tex/", packed=b"\3", method=8, mode=stat.S_IFDIR | 0o755)), "tex/"),
    "duplicate": (package(Entry("a.png", b"x"), Entry("a.png", b"y")), "a.png"),
    "case clash": (package(Entry("a.png", b"x"), Entry("A.png", b"y")), "A.png"),
    "case clash of folders": (package(Entry("tex/a.png", b"x"), Entry("Tex/b.png", b"y")), "Tex/b.png"),
    "sharp s": (package(Entry("stra\u00dfe.png", b"x"), Entry("strasse.png", b"y")), "strasse.png"),
    "normal forms": (package(Entry("\u00e9.png", b"x"), Entry("e\u0301.png", b"y")), "e\u0301.png"),
    "file and folder": (package(Entry("tex", b"x"), Entry("tex/a.png", b"y")), "tex/a.png"),
    "file and folder, by case": (package(Entry("tex/a.png", b"x"), Entry("TEX", b"y")), "TEX"),
    "encrypted": (package(Entry("a.png", b"x", flags=1)), "a.png"),
    "strongly encrypted": (package(Entry("a.png", b"x", flags=0x41)), "a.png"),
    "another method": (package(Entry("a.png", b"x", method=14)), "a.png"),
    "not UTF-8": (package(Entry(b"caf\xe9.png", b"x")), "caf\\xe9.png"),
    "two names": (package(Entry("a.png", b"x", extra=struct.pack("<HHBI", 0x7075, 10, 1, 0) + b"b.png")), "a.png"),
    "zip in zip": (package(Entry("more.dat", zip_of(Entry("x.usda", LAYER)))), "more.dat"),
    "deflated zip in zip": (package(Entry("m.png", zip_of(Entry("x.usda", LAYER)), deflate=True)), "m.png"),
    "gzip": (package(Entry("a.usda.gz", b"\x1f\x8b\x08\0\0\0\0\0\0\x03")), "a.usda.gz"),
    "tar": (package(Entry("a.dat", b"\0" * 257 + b"ustar\x0000" + b"\0" * 248)), "a.dat"),
    "7-Zip": (package(Entry("a.dat", b"7z\xbc\xaf\x27\x1c\0\4")), "a.dat"),
    "local name differs": (package(Entry("a.png", b"x", local_name="../b.png")), "a.png"),
    "local size differs": (package(Entry("a.png", b"xy", local_size=1)), "a.png"),
    "local sum differs": (package(Entry("a.png", b"xy", local_crc=1)), "a.png"),
    "local method differs": (package(Entry("a.png", b"xy", local_method=8)), "a.png"),
    "wrong sum": (package(Entry("a.png", b"xy", crc=7)), "a.png"),
    "larger than said": (package(Entry("a.png", b"x" * 100, deflate=True, size=10)), "a.png"),
    "smaller than said": (package(Entry("a.png", b"x" * 100, deflate=True, size=1000)), "a.png"),
    "stored sizes differ": (package(Entry("a.png", b"xy", size=3)), "a.png"),
    "damaged": (package(Entry("a.png", b"xy", packed=b"\xff\xff\xff\xff", method=8)), "a.png"),
    "cut off": (package(Entry("a.png", b"x" * 999, packed=zlib.compress(b"x" * 999)[2:-6], method=8)), "a.png"),
    "data after the end": (package(Entry("a.png", b"x", packed=zlib.compress(b"x")[2:-4] + b"more", method=8)), "a.png"),
    "deep": (package(Entry("d/" * 100 + "a.png", b"x")), None),
    "long": (package(Entry("d" * 200 + "/" + "e" * 200 + "/" + "f" * 700, b"x")), None),
    "long part": (package(Entry("d" * 300 + ".png", b"x")), None),
    "overlapping": (zip_of(Entry("shot.usda", LAYER), Entry("a.png", LAYER, offset=0, local_name="shot.usda")), "a.png"),
    "too many": (package(*(Entry(f"{i}.png", b"x") for i in range(ENTRIES))), None),
    "says fewer than there are": (zip_of(Entry("shot.usda", LAYER), Entry("a.png", b"x"), count=1), None),
    "says more than there are": (zip_of(Entry("shot.usda", LAYER), count=2), None),
    "appended": (package() + b"more", None),
    "prepended, places shifted": (b"PK\x03\x04" + package(), None),
    "no directory": (package()[:-22], None),
}  # fmt: skip


@pytest.mark.parametrize("case", UNSAFE)
def test_an_unsafe_package_is_refused_with_the_member(case: str, post: Any, server: RunningServer) -> None:
    body, member = UNSAFE[case]
    answer = post(body)
    assert answer.status_code == 422, answer.text
    problem = answer.json()
    assert problem["type"] == "/problems/package-unsafe"
    if member is not None:
        assert problem["member"] == member
    assert ("symbolic link" in problem["detail"]) == case.startswith("symlink")
    assert left_over(server.data) == []


def quoted_bomb(members: int, size: int) -> bytes:
    """Members whose directory entries all point into the same data (Fifield 2019, without quoting: the first header)."""
    kernel = Entry("shot.usda", LAYER)
    bomb = Entry("0.dat", b"\0" * size, deflate=True)
    rest = [Entry(f"{i}.dat", b"\0" * size, deflate=True, offset=30 + 9 + len(LAYER)) for i in range(1, members)]
    for entry in rest:
        entry.body = b""
        entry.local_name = b"0.dat"
    return zip_of(kernel, bomb, *rest)


BOMBS = {
    "ratio": package(Entry("a.dat", b"#" * (300 * 2**20), deflate=True)),
    "ratio, lying": package(Entry("a.dat", b"#" * (300 * 2**20), deflate=True, size=10)),
    "in all": package(*(Entry(f"{i}.dat", os.urandom(2**16) * 100, deflate=True) for i in range(12))),
    "many of a high ratio": package(*(Entry(f"{i}.dat", b"#" * 2**20, deflate=True) for i in range(45))),
}


@pytest.mark.parametrize("case", BOMBS)
def test_a_bomb_is_refused_while_it_is_unpacked_and_its_disk_freed(case: str, post: Any, server: RunningServer) -> None:
    answer = post(BOMBS[case])
    assert answer.status_code == 422, answer.text
    problem = answer.json()
    assert problem["type"] == "/problems/package-too-large"
    assert problem["member"].endswith(".dat")
    assert left_over(server.data) == []


def test_a_member_inside_of_another_is_refused(post: Any) -> None:
    """All headers agree: the outer member's data are the inner one's header and data (Fifield's quoting)."""
    first = Entry("shot.usda", LAYER)
    inner = zip_of(Entry("inner.dat", b"\0" * 500, deflate=True))
    outer = Entry("outer.dat", inner[: inner.index(b"PK\x01\x02")])
    at = len(LAYER) + 30 + len("shot.usda") + 30 + len("outer.dat")
    answer = post(zip_of(first, outer, Entry("inner.dat", b"\0" * 500, deflate=True, offset=at)))
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/package-unsafe"), answer.text
    assert "shares bytes" in answer.json()["detail"]


def test_members_that_share_bytes_are_refused(post: Any) -> None:
    answer = post(quoted_bomb(20, 2**20))
    assert answer.status_code == 422
    assert answer.json()["type"] == "/problems/package-unsafe"


@pytest.mark.parametrize(
    "body",
    [
        zip_of(),
        zip_of(Entry("readme.txt", b"no scene")),
        zip_of(Entry("__MACOSX/._shot.usda", b"x"), Entry(".hidden.usda", LAYER)),
    ],
)
def test_a_package_without_a_layer_is_not_usd(body: bytes, post: Any) -> None:
    answer = post(body)
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/not-usd")


def test_a_plain_package_is_taken_and_unpacked_as_it_is(post: Any, server: RunningServer) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("shot.usda", LAYER)
        file.mkdir("tex")
        file.writestr("tex/wood \u00e9.png", b"\x89PNG" + bytes(5000))
        file.writestr("__MACOSX/._shot.usda", b"x")
        file.writestr("part.usdz", zip_of(Entry("x.usda", LAYER)))
    answer = post(buffer.getvalue())
    assert answer.status_code == 201, answer.text
    scene = answer.json()
    assert (scene["kind"], scene["state"]) == ("zip", "checking")
    folder = server.data / "scenes" / scene["id"][7:]
    assert (folder / "package/tex/wood \u00e9.png").read_bytes() == b"\x89PNG" + bytes(5000)
    assert stat.S_IMODE((folder / "package/shot.usda").stat().st_mode) == 0o600
    files = sum(f.stat().st_size for f in (folder / "package").rglob("*") if f.is_file())
    assert scene["stored_bytes"] == len(buffer.getvalue()) + files


def test_a_stream_written_zip_with_sizes_after_the_data_is_read(post: Any) -> None:
    class Unseekable(io.BytesIO):
        def seekable(self) -> bool:
            return False

        def seek(self, *_: Any) -> int:
            raise io.UnsupportedOperation

        def tell(self) -> int:
            raise io.UnsupportedOperation

    buffer = Unseekable()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("streamed.usda", LAYER)
        file.writestr("a.png", b"x" * 1000)
    answer = post(buffer.getvalue())
    assert answer.status_code == 201, answer.text


ZIP64_FOLDER = struct.pack("<HHQQ", 1, 16, 0, 2)


@pytest.mark.parametrize(
    "folder",
    [
        Entry("tex/", deflate=True, mode=stat.S_IFDIR | 0o755),  # as Python and Java write it: two bytes of no bytes
        Entry("tex/", packed=b"\1\0\0\xff\xff", method=8, mode=stat.S_IFDIR | 0o755),  # an empty stored block
        Entry("tex/", deflate=True, flags=8, mode=0, made_by=0),  # sizes in a descriptor
        Entry("tex/", deflate=True, size=0xFFFFFFFF, packed_size=0xFFFFFFFF, extra=ZIP64_FOLDER, mode=stat.S_IFDIR | 0o755),
    ],
    ids=["fixed", "stored", "descriptor", "zip64"],
)
def test_a_deflated_folder_holds_nothing(folder: Entry, post: Any) -> None:
    another = Entry(
        f"of_{len(folder.body)}_{folder.flags}_{len(folder.extra)}.png", b"y"
    )  # else the scene is one that is there
    answer = post(package(folder, Entry("tex/a.png", b"x"), another))
    assert answer.status_code == 201, answer.text


def test_zip64_is_read(post: Any) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file, file.open("big.usda", "w", force_zip64=True) as member:
        member.write(LAYER)
    assert post(buffer.getvalue()).status_code == 201


def test_a_usdz_is_known_by_its_bytes_and_not_unpacked(post: Any, server: RunningServer) -> None:
    body = zip_of(Entry("root.usda", LAYER, align=True), Entry("tex/a.png", b"\x89PNG", align=True))
    scene = post(body, "whatever.bin").json()
    assert scene["kind"] == "usdz"
    assert not (server.data / "scenes" / scene["id"][7:] / "package").exists()


@pytest.mark.parametrize(
    ("body", "member"),
    [
        (zip_of(Entry("root.usda", LAYER, deflate=True)), "root.usda"),
        (zip_of(Entry("a.png", b"x", align=True), Entry("root.usda", LAYER, align=True)), "a.png"),
        (zip_of(Entry("/root.usda", LAYER, align=True)), "/root.usda"),
        (zip_of(Entry("root.usda", LAYER + b"# not aligned")), "root.usda"),
    ],
)
def test_what_is_called_usdz_has_to_be_one(body: bytes, member: str, post: Any) -> None:
    answer = post(body, "scene.usdz")
    assert (answer.status_code, answer.json()["type"], answer.json()["member"]) == (422, "/problems/package-unsafe", member)
