"""Small files that want more than they may have: time, memory, stack, disk. Each ends as the threat table says, in seconds."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import pytest
from tests.service.threats.conftest import LIMITS
from tests.service.threats.fates import ROOM, fate, package, usda

MiB = 2**20


def ended(found: Any, *slugs: str) -> None:
    assert found.end in ("failed", "rejected"), (found.end, found.job.get("warnings"))
    assert found.slug in slugs, found.problem


def nested_dictionaries(depth: int) -> str:
    return usda("", "customLayerData = " + "{ dictionary a = " * depth + "{}" + "\n}" * depth)


def nested_prims(depth: int) -> str:
    return usda("".join(f'def "p{i}" {{\n' for i in range(depth)) + "}\n" * depth)


DEEP = {
    "dictionaries": nested_dictionaries(50_000),
    "arrays": usda('def "R" { int[] a = ' + "[" * 200_000 + "]" * 200_000 + " }"),
    "prims": nested_prims(20_000),
    "variants": usda('def "R" {' + 'variantSet "v" = { "a" {\n' * 20_000 + "}\n}" * 20_000 + "\n}"),
    "expressions": usda('def "R" (references = @`' + "if(true, " * 20_000 + '"a"' + ", \"b\")" * 20_000 + "`@) {}"),
    "brackets in a usdc that is none": "PXR-USDC" + "{" * 100_000,
}  # fmt: skip


@pytest.mark.parametrize("what", DEEP)
def test_deep_nesting_never_takes_the_server_with_it(what: str, client: Any) -> None:
    found = fate(client, DEEP[what])
    ended(found, "renderer-crashed", "scene-too-large", "layer-unreadable", "time-limit", "memory-limit", "not-usd")
    if found.slug == "renderer-crashed":
        assert found.problem["signal"] in ("SIGSEGV", "SIGABRT", "SIGBUS")


def test_a_depth_that_is_allowed_is_read(client: Any) -> None:
    found = fate(client, usda(ROOM) + nested_prims(900).removeprefix("#usda 1.0\n"))
    assert found.end == "succeeded", found.problem


def reference_bomb(levels: int, width: int, instanceable: bool = False) -> str:
    """`width` references to the next level, at each of `levels`: width^levels prims from a few kilobytes."""
    flag = "instanceable = true; " if instanceable else ""
    body = f'def Xform "L{levels}" {{ def Sphere "s" {{}} }}\n'
    for level in range(levels):
        inside = "".join(f'def "p{i}" ({flag}references = </L{level + 1}>) {{}}\n' for i in range(width))
        body += f'def Xform "L{level}" {{\n{inside}}}\n'
    return usda(ROOM + body)


BOMBS = {
    "references": reference_bomb(9, 10),
    "instances": reference_bomb(9, 10, instanceable=True),
    "clip template": usda(
        ROOM + 'def "R" (clips = { dictionary default = { double templateStartTime = 1; double templateEndTime = 1e9; '
        'double templateStride = 1e-7; string templateAssetPath = "./c.######.usda"; string primPath = "/X" } }) {}'
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BOMBS)
def test_what_expands_without_end_is_ended(what: str, client: Any) -> None:
    found = fate(client, BOMBS[what])
    ended(found, "time-limit", "scene-too-large", "memory-limit")
    assert found.cost_s < 60
    if found.slug == "time-limit":
        assert found.problem["limit"] in (LIMITS["check_cpu_s"], LIMITS["load_cpu_s"])


def instancer_bomb(levels: int, count: int) -> str:
    """Instancers whose prototypes are instancers: count^levels spheres."""
    positions = ",".join(f"({i},0,0)" for i in range(count))
    body, path = 'def Sphere "s" {}\n', "/P"
    for level in range(levels - 1, -1, -1):
        name, target = ("P", "n1") if level == 0 else (f"n{level}", f"n{level + 1}")
        target = "s" if level == levels - 1 else target
        path = "/P" + "".join(f"/n{i}" for i in range(1, level + 1))
        body = (
            f'def PointInstancer "{name}" {{\nrel prototypes = <{path}/{target}>\nint[] protoIndices = '
            f"[{','.join(['0'] * count)}]\npoint3f[] positions = [{positions}]\n{body}}}\n"
        )
    return usda(ROOM + body)


@pytest.mark.parametrize(("levels", "count"), [(2, 20_000), (4, 1_000)])
def test_instances_of_instances_are_refused_or_cost_little(levels: int, count: int, client: Any) -> None:
    """The renderer places instances of instances without expanding them: then there is no bomb."""
    found = fate(client, instancer_bomb(levels, count))
    assert found.cost_s < 60
    if found.end == "succeeded":
        assert found.job["usage"]["peak_rss_bytes"] < LIMITS["memory_bytes"]
    else:
        ended(found, "time-limit", "scene-too-large", "memory-limit")


def test_cycles_are_warnings_or_refusals_never_a_hang(client: Any) -> None:
    files = {
        "a.usda": usda(ROOM + 'def "R" (references = @b.usda@</R>) {}', "subLayers = [@b.usda@]"),
        "b.usda": usda('def "R" (references = @a.usda@</R>) {}', "subLayers = [@a.usda@]"),
    }
    found = fate(client, package(files), entry="a.usda")
    assert found.end in ("succeeded", "failed", "rejected")
    assert found.cost_s < 30
    assert found.warnings or found.slug


def image_header(width: int, height: int) -> bytes:
    """A PNG of zeros that decodes to three bytes a pixel."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = zlib.compressobj(9)
    row = b"\0" * (1 + 3 * width)
    body = b"".join(rows.compress(row) for _ in range(height)) + rows.flush()
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def test_an_image_that_decodes_to_more_than_is_allowed(start_server: Any) -> None:
    server = start_server(limits={**LIMITS, "texture_bytes": 16 * MiB})
    dome = usda(ROOM + 'def DomeLight "D" { asset inputs:texture:file = @sky.png@ }')
    found = fate(server.client(), package({"root.usda": dome, "sky.png": image_header(6000, 6000)}))
    if found.end == "succeeded":
        assert any("texture" in code for code in found.warnings), found.warnings
    else:
        ended(found, "scene-too-large", "memory-limit", "scene-rejected")


SUBDIVIDED = """def Mesh "M" { uniform token subdivisionScheme = "catmullClark"
int[] faceVertexCounts = [4]; int[] faceVertexIndices = [0, 1, 2, 3]
point3f[] points = [(-1e9, -1e9, 0), (1e9, -1e9, 0), (1e9, 1e9, 0), (-1e9, 1e9, 0)] }"""
ODD = {
    "NaN and infinity": 'def Mesh "M" { int[] faceVertexCounts = [3]; int[] faceVertexIndices = [0, 1, 2]; '
    "point3f[] points = [(nan, inf, -inf), (1e38, -1e38, 0), (0, 0, nan)] }",
    "indices out of range": 'def Mesh "M" { int[] faceVertexCounts = [3, 4]; int[] faceVertexIndices = [0, -1, 2147483647, 9]; '
    "point3f[] points = [(0, 0, 0)] }",
    "counts that are none": 'def Mesh "M" { int[] faceVertexCounts = [0, -5, 2147483647]; int[] faceVertexIndices = [0]; '
    "point3f[] points = [(0, 0, 0)] }",
    "negative sizes": 'def Sphere "S" { double radius = -1 }\ndef RectLight "L" { float inputs:width = -1 }\n'
    'def Cylinder "C" { double radius = nan; double height = inf }',
    "a wide patch, subdivided": SUBDIVIDED,
    "an instancer that lies": 'def PointInstancer "P" { rel prototypes = </P/s>; int[] protoIndices = [0, 99, -1]; '
    'point3f[] positions = [(0, 0, 0)]\ndef Sphere "s" {} }',
    "a camera that sees nothing": 'over "cam" { float focalLength = 0; float horizontalAperture = nan; '
    "float2 clippingRange = (5, -5) }",
}


@pytest.mark.parametrize("what", ODD)
def test_odd_numbers_are_warnings_never_a_crash(what: str, client: Any) -> None:
    found = fate(client, usda(ROOM + ODD[what]))
    assert found.end in ("succeeded", "failed", "rejected")
    assert found.slug != "renderer-crashed", found.problem
    assert found.warnings or found.slug, "it is told"


def test_a_package_of_two_thousand_layers_is_refused_by_its_limit(start_server: Any) -> None:
    server = start_server(limits={**LIMITS, "layers": 50})
    files: dict[str, str | bytes] = {"root.usda": usda(ROOM)}
    files |= {f"l/{i}.usda": usda() for i in range(60)}
    found = fate(server.client(), package(files))
    ended(found, "scene-too-large")
    assert (found.problem["count"], found.problem["limit"]) == (61, 50)


def test_outputs_over_the_limit_end_the_job(start_server: Any) -> None:
    server = start_server(limits={**LIMITS, "output_bytes": MiB})
    found = fate(server.client(), usda(ROOM), settings={"resolution": [1024, 1024], "stop": {"max_samples": 1}})
    ended(found, "storage-limit")


def test_memory_over_the_limit_ends_the_job(start_server: Any) -> None:
    server = start_server(limits={**LIMITS, "memory_bytes": 256 * MiB})
    found = fate(server.client(), usda(ROOM), settings={"resolution": [8192, 8000], "stop": {"max_samples": 1}})
    ended(found, "memory-limit", "scene-too-large", "limit-exceeded")
