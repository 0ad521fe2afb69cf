"""`primray mcp` by the SDK's client: in its process, over stdio and over HTTP."""

from __future__ import annotations

import asyncio
import base64
import itertools
import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from primray_service.sandbox import works

pytest.importorskip("mcp", reason="no mcp")
if not works():
    pytest.skip("no sandbox", allow_module_level=True)

import mcp
from mcp.client.stdio import StdioServerParameters, stdio_client
from mcp_types import BlobResourceContents

from primray_service.agents import looks
from primray_service.agents.scene_processes import SceneLimits, SceneProcesses, _moved
from primray_service.agents.server import Access, create_server
from primray_service.worker.channel import SERVER_GONE

from .conftest import STAGE, Answer, read

GiB = 2**30
PRIMRAY = [str(Path(sys.executable).with_name("primray")), "mcp"]


def _run(folder: Path, calls: Callable[[mcp.Client], Awaitable[None]], memory: int = 2 * GiB) -> None:
    output = folder.parent / "out"
    output.mkdir(exist_ok=True)

    async def run() -> None:
        app = create_server(Access(roots=(folder.resolve(),), output=output), SceneLimits(memory_bytes=memory, threads=2))
        async with mcp.Client(app) as client:
            await calls(client)

    asyncio.run(run())


async def _refused(client: mcp.Client, tool: str, **arguments: Any) -> str:
    result = await client.call_tool(tool, arguments)
    assert result.is_error
    return " ".join(item.text for item in result.content if item.type == "text")


async def _asked(client: mcp.Client, tool: str, **arguments: Any) -> Answer:
    return read(await client.call_tool(tool, arguments))


def test_a_look_says_what_is_seen_where(folder: Path) -> None:
    async def calls(client: mcp.Client) -> None:
        found = await _asked(client, "look", scene="toys.usda", views=["default", "top"], size=256)
        default, top = found.table["views"]
        assert default["camera"] == "/world/camera"
        rows = {row["prim"]: row for row in default["seen"]}
        assert rows["/world/ball"]["label"] == "toy"
        assert "label" not in rows["/world/box"]
        assert rows["/world/ball"]["middle"][0] < default["size"][0] / 2 < rows["/world/box"]["middle"][0]
        assert 9 < rows["/world/ball"]["distance"] < 13
        shares = sum(row["share_percent"] for row in default["seen"]) + default["background_percent"]
        assert shares == pytest.approx(100, abs=0.1)
        assert 20 < top["background_percent"] < 60
        assert top["camera"] == ""
        assert set(found.pictures) == {"default", "top"}
        for content in found.pictures.values():
            assert len(content) <= 250_000
            assert content[:4] in (b"\x89PNG", b"\xff\xd8\xff\xe0")

    _run(folder, calls)


def test_an_edit_is_compared_with_the_last_look(folder: Path) -> None:
    async def calls(client: mcp.Client) -> None:
        stage = folder / "toys.usda"
        refusal = await _refused(client, "compare", scene="toys.usda", size=192)
        assert "no-look-before" in refusal
        await _asked(client, "look", scene="toys.usda", size=192, seconds=3)
        same = await _asked(client, "compare", scene="toys.usda", size=192)
        assert same.table["identical"]
        assert same.table["verdict"] == "unchanged"
        assert same.table["prims"] == []
        stage.write_text(STAGE.replace("(0.8, 0.1, 0.1)", "(0.1, 0.8, 0.1)").replace("(1.5, 0, 0.8)", "(2.5, 0, 0.8)"))
        found = await _asked(client, "compare", scene="toys.usda", size=192)
        assert found.table["verdict"] == "changed"
        rows = {row["prim"]: row for row in found.table["prims"]}
        assert rows["/world/ball"]["seen_percent_before"] == rows["/world/ball"]["seen_percent_after"] > 0
        assert rows["/world/ball"]["changed_percent_of_picture"] > 0.5
        assert rows["/world/box"]["changed_percent_of_picture"] > 0.2
        assert set(found.pictures) == {"before", "after", "changes"}
        again = await _asked(client, "compare", scene="toys.usda", size=192)
        assert again.table["identical"]  # the last one shown is what the next is compared with

    _run(folder, calls)


def test_two_stages_are_compared(folder: Path) -> None:
    (folder / "bright.usda").write_text(STAGE.replace("intensity = 3000", "intensity = 6000"))

    async def calls(client: mcp.Client) -> None:
        found = await _asked(client, "compare", scene="bright.usda", before="toys.usda", size=192)
        assert found.table["verdict"] == "changed"
        rows = {row["prim"]: row for row in found.table["prims"]}
        # relative to the mean of both, which is half as much again as before
        assert rows["/world/ground"]["brighter_percent"] == pytest.approx(100 / 1.5, abs=1)

    _run(folder, calls)


def test_stages_are_inspected_examined_estimated_and_rendered(folder: Path) -> None:
    async def calls(client: mcp.Client) -> None:
        facts = (await _asked(client, "inspect", scene="toys.usda")).table
        assert facts["cameras"] == ["/world/camera"]
        assert facts["lights"][0]["path"] == "/world/sun"
        findings = (await _asked(client, "doctor", scene="toys.usda", size=96, seconds=0.3)).table
        assert findings["picture"]["hit_share"] > 0.1
        costs = (await _asked(client, "estimate", scene="toys.usda", target_errors=[0.01], size=96, seconds=0.3)).table
        assert len(costs["targets"]) == 1
        made = await _asked(client, "render", scene="toys.usda", name="toys", size=128, target_error=0.05, seconds=20)
        assert Path(made.table["file"]).read_bytes()[:4] == b"\x76\x2f\x31\x01"
        assert set(made.pictures) == {"render"}

    _run(folder, calls)


def test_a_larger_picture_is_a_resource(folder: Path) -> None:
    async def calls(client: mcp.Client) -> None:
        small = await client.call_tool("render", {"scene": "toys.usda", "name": "small", "size": 128, "target_error": 0.1})
        assert [item for item in small.content if item.type == "resource_link"] == []
        arguments = {"scene": "toys.usda", "name": "large", "size": 1000, "target_error": 0.1, "seconds": 10}
        large = await client.call_tool("render", arguments)
        read(large)
        (link,) = (item for item in large.content if item.type == "resource_link")
        (content,) = (await client.read_resource(link.uri)).contents
        assert isinstance(content, BlobResourceContents)
        png = base64.b64decode(content.blob)
        assert content.mime_type == link.mime_type == "image/png"
        assert (len(png), struct.unpack(">II", png[16:24])[0]) == (link.size, 1000)
        for name in ("none", "../out/large", "%2e%2e%2flarge"):
            with pytest.raises(Exception, match=r"no-such-picture|Unknown resource|not found|Error reading"):
                await client.read_resource(f"primray://picture/{name}")

    _run(folder, calls)


def test_a_long_answer_reports_progress(folder: Path) -> None:
    told: list[tuple[float, float | None]] = []

    async def note(progress: float, total: float | None, message: str | None) -> None:
        told.append((progress, total))

    async def calls(client: mcp.Client) -> None:
        arguments = {"scene": "toys.usda", "name": "toys", "target_error": 1e-9, "seconds": 4}
        read(await client.call_tool("render", arguments, progress_callback=note))
        assert len(told) >= 3
        assert all(later > earlier for (earlier, _), (later, _) in itertools.pairwise(told))
        assert all(total is not None and total >= progress for progress, total in told)

    _run(folder, calls)


def test_a_denoised_look_has_less_noise(folder: Path) -> None:
    pytest.importorskip("pyoidn", reason="no pyoidn")
    wide = STAGE.replace("inputs:angle = 2\n", "inputs:angle = 60\n").replace("intensity = 3000", "intensity = 3")
    (folder / "toys.usda").write_text(wide)

    async def calls(client: mcp.Client) -> None:
        asked = {"scene": "toys.usda", "views": ["/world/camera"], "size": 160, "seconds": 0.1}
        plain, smooth = [await _asked(client, "look", **asked, denoise=denoise) for denoise in (False, True)]
        for (row,) in (plain.table["views"], smooth.table["views"]):
            assert row["seen"][0]["prim"] == "/world/ground"
        assert _roughness(smooth.pictures["/world/camera"]) < 0.8 * _roughness(plain.pictures["/world/camera"])
        same = await _asked(client, "compare", scene="toys.usda", view="/world/camera", size=160)
        assert same.table["identical"]  # what was rendered, however it was shown

    _run(folder, calls)


def _roughness(picture: bytes) -> float:
    """Return how much a pixel differs from those beside it."""
    import numpy as np
    import OpenImageIO as oiio

    with tempfile.NamedTemporaryFile(suffix=".png" if picture.startswith(b"\x89PNG") else ".jpg") as file:
        file.write(picture)
        file.flush()
        values = np.asarray(oiio.ImageBuf(file.name).get_pixels(oiio.FLOAT))
    return float(np.abs(np.diff(values, axis=1)).mean())


def test_refusals_have_a_code_and_a_place(folder: Path) -> None:
    (folder.parent / "secret.usda").write_text(STAGE)
    (folder / "broken.usda").write_text("#usda 1.0\ndef {")
    (folder / "link.usda").symlink_to(folder.parent / "secret.usda")

    async def calls(client: mcp.Client) -> None:
        for path in ("../secret.usda", str(folder.parent / "secret.usda"), "link.usda", "/etc/passwd"):
            assert re.search(r"outside-roots: .* \[scene\]", await _refused(client, "look", scene=path)), path
        assert "no-such-stage" in await _refused(client, "look", scene="none.usda")
        assert re.search(r"stage-open: .*broken", await _refused(client, "look", scene="broken.usda"))
        assert re.search(r"\[/nosuch\]|nosuch", await _refused(client, "look", scene="toys.usda", views=["/nosuch"]))
        assert "argument: look has no argument sise [sise]" in await _refused(client, "look", scene="toys.usda", sise=3)
        refusal = await _refused(client, "look", scene="toys.usda", size=5000)
        assert "argument: size should be less than or equal to 768, not 5000 [size]" in refusal
        assert "argument: render needs name [name]" in await _refused(client, "render", scene="toys.usda")
        assert "pydantic" not in await _refused(client, "estimate", scene="toys.usda", target_errors=["x"])
        assert "time:" in await _refused(client, "render", scene="toys.usda", name="x", seconds=1e6)
        assert "nothing-to-frame" in await _refused(client, "look", scene="toys.usda", views=["top"], frame="/nosuch")
        (folder / "broken.usda").write_text(STAGE)  # mended
        await _asked(client, "look", scene="broken.usda", size=64)

    _run(folder, calls)


@pytest.mark.parametrize("tool", ["look", "compare", "inspect", "doctor", "estimate", "render"])
def test_times_that_nobody_means_are_refused(folder: Path, tool: str) -> None:
    more = {"name": "x"} if tool == "render" else {"before": "toys.usda"} if tool == "compare" else {}

    async def calls(client: mcp.Client) -> None:
        for when in (1e308, -1e308, 1e17, "NaN", "Infinity"):
            assert "time_code]" in await _refused(client, tool, scene="toys.usda", time_code=when, **more), when

    _run(folder, calls)


def test_views_that_are_none_are_refused_with_those_there_are(folder: Path) -> None:
    async def calls(client: mcp.Client) -> None:
        for view in ("1e308,0", "0,1e308", "NaN,0", "0,90", "720,0"):
            assert re.search(r" view: .*from -360 to 360", await _refused(client, "look", scene="toys.usda", views=[view])), (
                view
            )
        for view in ("FRONT", "45", "/world/ball"):
            assert "three-quarter" in await _refused(client, "look", scene="toys.usda", views=[view]), view
        assert "[views.0]" in await _refused(client, "look", scene="toys.usda", views=[""])

    _run(folder, calls)


def test_a_frame_is_heeded_or_refused(folder: Path) -> None:
    """The default view of a prim is three-quarter: a camera of the stage would show it as large as it is there."""

    async def calls(client: mcp.Client) -> None:
        framed = await _asked(client, "look", scene="toys.usda", frame="/world/ball", size=96)
        named = await _asked(client, "look", scene="toys.usda", frame="/world/ball", views=["three-quarter"], size=96)
        share = {row["prim"]: row["share_percent"] for row in framed.table["views"][0]["seen"]}
        assert share["/world/ball"] > 10
        assert framed.table["views"][0]["position"] == named.table["views"][0]["position"]
        for frame in ("/nosuch", "nosuch"):
            assert "nothing-to-frame" in await _refused(client, "look", scene="toys.usda", frame=frame)
        refusal = await _refused(client, "look", scene="toys.usda", frame="/world/ball", views=["/world/camera"])
        assert re.search(r" view: .* \[frame\]", refusal)
        assert "[frame]" in await _refused(client, "look", scene="toys.usda", frame="")

    _run(folder, calls)


def test_a_stage_in_a_root_cannot_show_files_outside(folder: Path) -> None:
    """The sandbox holds whatever composition follows, not only the path that is given."""
    (folder.parent / "secret.usda").write_text(STAGE)
    (folder / "thief.usda").write_text('#usda 1.0\n(\n    subLayers = [@../secret.usda@]\n)\ndef Cube "own" {}\n')

    async def calls(client: mcp.Client) -> None:
        found = await _asked(client, "look", scene="thief.usda", size=64)
        assert [row["prim"] for row in found.table["views"][0]["seen"]] == ["/own"]
        assert any("secret" in str(note) for note in found.table["diagnostics"])

    _run(folder, calls)


def _inspect(path: str) -> dict[str, Any]:
    return {"do": "inspect", "path": path, "time_code": None, "camera": None, "variants": [], "seconds": 1}


def test_a_scene_whose_process_dies_costs_one_answer(folder: Path) -> None:
    async def calls() -> None:
        scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=2))
        path = str(folder / "toys.usda")
        request = _inspect(path)
        await scenes.answer(path, request, 60)
        (process,) = scenes._known.values()
        asking = asyncio.create_task(scenes.answer(path, {**request, "do": "doctor", "size": 256, "seconds": 20}, 60))
        await asyncio.sleep(1)
        os.killpg(process.child.pid, signal.SIGKILL)
        with pytest.raises(Exception, match="scene-process"):
            await asking
        assert (await scenes.answer(path, request, 60))["answer"]["cameras"] == ["/world/camera"]
        with pytest.raises(Exception, match="time: there was no answer"):
            await scenes.answer(path, {**request, "do": "doctor", "size": 256, "seconds": 20}, 0.2)
        assert scenes.count == 0
        await scenes.close()

    asyncio.run(calls())


def test_who_waits_behind_a_request_that_takes_too_long_is_answered(folder: Path) -> None:
    async def calls() -> None:
        scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=2))
        path = str(folder / "toys.usda")
        request = _inspect(path)
        await scenes.answer(path, request, 60)
        first = asyncio.create_task(scenes.answer(path, {**request, "do": "doctor", "size": 256, "seconds": 20}, 0.2))
        second = asyncio.create_task(scenes.answer(path, request, 60))
        with pytest.raises(Exception, match="time: there was no answer"):
            await first
        assert (await second)["answer"]["cameras"] == ["/world/camera"]
        await scenes.close()

    asyncio.run(calls())


def test_scenes_that_were_not_used_longest_end_for_memory(folder: Path) -> None:
    (folder / "second.usda").write_text(STAGE)

    async def calls() -> None:
        scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=1))
        for name in ("toys.usda", "second.usda"):
            path = str(folder / name)
            request = _inspect(path)
            await scenes.answer(path, request, 60)
        assert scenes.count == 2
        held = scenes._held_by_scenes()
        scenes._limits = SceneLimits(memory_bytes=held - 1, threads=1)
        await scenes.answer(path, request, 60)
        assert list(scenes._known) == [path]
        await scenes.close()

    asyncio.run(calls())


def test_a_process_is_ready_for_the_next_scene(folder: Path) -> None:
    async def calls() -> None:
        scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=1))
        scenes.get_ready()
        assert scenes._ready is not None
        ready = await scenes._ready
        path = str(folder / "toys.usda")
        await scenes.answer(path, _inspect(path), 60)
        assert list(scenes._known.values()) == [ready]
        assert scenes._ready is not None
        other = await scenes._ready
        os.killpg(other.child.pid, signal.SIGKILL)  # one that died is not used
        await other.child.wait()
        second = str(folder / "second.usda")
        Path(second).write_text(STAGE)
        await scenes.answer(second, _inspect(second), 60)
        assert scenes._known[second] not in (ready, other)
        left = scenes._ready
        assert left is not None
        await scenes.close()
        assert left.cancelled() or not left.result().is_alive()

    asyncio.run(calls())


def test_no_process_is_ready_where_scenes_need_the_memory(folder: Path) -> None:
    async def calls() -> None:
        scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=1))
        path = str(folder / "toys.usda")
        await scenes.answer(path, _inspect(path), 60)
        assert scenes._ready is not None
        await (await scenes._ready).end()
        scenes._ready = None
        scenes._limits = SceneLimits(memory_bytes=scenes._held_by_scenes(), threads=1)
        scenes.get_ready()
        assert scenes._ready is None
        await scenes.close()

    asyncio.run(calls())


def test_a_server_that_ends_while_a_process_starts_leaves_none(folder: Path) -> None:
    async def calls() -> None:
        for delay in (0.0, 0.01, 0.03, 0.1):  # as bubblewrap starts another process, and before and after
            scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=1))
            scenes.get_ready()
            await asyncio.sleep(delay)
            async with asyncio.timeout(60):
                await scenes.close()
            assert _processes_for(folder) == []

    asyncio.run(calls())


def test_the_end_of_stdin_ends_a_process_at_once(folder: Path) -> None:
    async def calls() -> None:
        scenes = SceneProcesses([folder.resolve()], SceneLimits(memory_bytes=2 * GiB, threads=1))
        path = str(folder / "toys.usda")
        await scenes.answer(path, _inspect(path), 60)
        (process,) = scenes._known.values()
        assert process.child.stdin is not None
        asking = asyncio.create_task(process.ask({**_inspect(path), "do": "doctor", "size": 256, "seconds": 300}, 300))
        await asyncio.sleep(1)
        process.child.stdin.close()
        async with asyncio.timeout(60):
            with pytest.raises(EOFError):
                await asking
            assert await process.child.wait() == SERVER_GONE
        await scenes.close()

    asyncio.run(calls())


def test_processes_end_with_a_server_that_is_killed(folder: Path) -> None:
    server = subprocess.Popen(
        [*PRIMRAY, "--root", str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdin.write(_lines(HELLO, INITIALIZED, _call("look", scene="toys.usda", size=64)))
    server.stdin.flush()
    while b'"id":2' not in server.stdout.readline().replace(b" ", b""):
        pass
    arguments = {"scene": "toys.usda", "name": "long", "target_error": 1e-9, "seconds": 60}
    server.stdin.write(_lines(_call("render", **arguments)))
    server.stdin.flush()
    time.sleep(0.5)
    assert len(_processes_for(folder)) > 0  # the scene's, and one that starts
    server.kill()
    server.communicate()
    for _ in range(300):
        if not _processes_for(folder):
            break
        time.sleep(0.1)
    assert _processes_for(folder) == []


def _processes_for(folder: Path) -> list[int]:
    """Return the sandboxed processes that may read a folder, and what bubblewrap runs around them."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if (place / "stat").read_text().rpartition(")")[2].split()[0] == "Z":
                continue  # it has ended, and nobody has asked how
            words = (place / "cmdline").read_bytes() + (place / "environ").read_bytes()
        except OSError:
            continue
        if b"primray_service.agents.scene_process" in words and str(folder).encode() in words:
            found.append(int(place.name))
    return found


def test_a_link_that_a_process_writes_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "render.exr").symlink_to(tmp_path / "secret")
    with pytest.raises(OSError, match="symbolic"):
        _moved(tmp_path / "render.exr", tmp_path / "copy.exr")
    assert not (tmp_path / "copy.exr").exists()


def test_tables_are_bounded() -> None:
    cut = looks.bounded({"many": list(range(1000)), "long": "x" * 5000, "nan": float("nan")})
    assert len(cut["many"]) == looks.MOST_ROWS + 1
    assert cut["many"][-1] == f"{1000 - looks.MOST_ROWS} more"
    assert len(cut["long"]) < 500
    assert cut["nan"] is None


def test_pictures_are_bounded() -> None:
    import numpy as np

    noise = np.random.default_rng(0).integers(0, 255, (768, 768, 3)).astype(np.uint8)
    found = looks.pictures_of(dict.fromkeys("abcdef", noise))
    assert sum(len(one["data"]) for one in found) < 2**20
    assert looks.pictures_of({"a": noise})[0]["type"] == "image/jpeg"
    assert looks.pictures_of({"a": np.zeros((64, 64, 3), np.uint8)})[0]["type"] == "image/png"


def _served(folder: Path) -> tuple[subprocess.Popen[bytes], int]:
    """Return a server over HTTP and its port, once it listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    child = subprocess.Popen([*PRIMRAY, "--root", str(folder), "--http", "--port", str(port)], stderr=subprocess.DEVNULL)
    for _ in range(600):
        with socket.socket() as trial:
            if trial.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.1)
    return child, port


@asynccontextmanager
async def _over_http(folder: Path) -> AsyncIterator[mcp.Client]:
    child, port = await asyncio.to_thread(_served, folder)
    try:
        async with mcp.Client(f"http://127.0.0.1:{port}/mcp") as client:
            yield client
    finally:
        child.send_signal(signal.SIGTERM)
        assert child.wait(30) in (0, -signal.SIGTERM)


@asynccontextmanager
async def _over_stdio(folder: Path) -> AsyncIterator[mcp.Client]:
    parameters = StdioServerParameters(command=PRIMRAY[0], args=[*PRIMRAY[1:], "--root", str(folder)])
    async with mcp.Client(stdio_client(parameters)) as client:
        yield client


@pytest.mark.parametrize("over", [_over_stdio, _over_http])
def test_the_command_serves(folder: Path, over: Any) -> None:
    async def calls() -> None:
        async with over(folder) as client:
            tools = {tool.name: tool for tool in (await client.list_tools()).tools}
            assert set(tools) == {"look", "inspect", "doctor", "compare", "estimate", "render"}
            assert all(tool.input_schema["additionalProperties"] is False for tool in tools.values())
            first = await _asked(client, "look", scene="toys.usda", size=128)
            assert first.table["views"][0]["seen"]
            begun = time.monotonic()
            await _asked(client, "look", scene="toys.usda", size=128)
            print(f"a look at a known stage {time.monotonic() - begun:.3f} s")
            assert "stage-open" in await _refused(client, "look", scene=_broken(folder))

    asyncio.run(calls())


def test_a_port_that_is_taken_is_refused(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        command = [*PRIMRAY, "--root", str(folder), "--http", "--port", str(port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr == f"error: port: port {port} of 127.0.0.1 cannot be listened on: Address already in use [port]\n"


CLIENT = """
import asyncio, mcp, sys
async def render():
    async with mcp.Client(f"http://127.0.0.1:{sys.argv[1]}/mcp") as client:
        await client.call_tool("render", dict(scene="toys.usda", name="slow", seconds=60, target_error=1e-12, size=4096))
asyncio.run(render())
"""


def test_a_signal_ends_a_server_that_is_rendering(folder: Path) -> None:
    server, port = _served(folder)
    client = subprocess.Popen([sys.executable, "-c", CLIENT, str(port)], stderr=subprocess.DEVNULL)
    try:
        time.sleep(6)  # the client's imports, its first call, and part of the minute that it asks for
        begun = time.monotonic()
        server.send_signal(signal.SIGTERM)
        assert server.wait(30) in (0, -signal.SIGTERM)
        assert time.monotonic() - begun < 20
    finally:
        server.kill()
        client.kill()
        client.wait()


def _broken(folder: Path) -> str:
    path = folder / "broken.usda"
    path.write_text("#usda 1.0\ndef {")
    return path.name


HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}},
}
INITIALIZED = {"jsonrpc": "2.0", "method": "notifications/initialized"}


def _call(tool: str, **arguments: Any) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": 2, "method": "tools/call", "params": {"name": tool, "arguments": arguments}}


def _lines(*messages: Any) -> bytes:
    return b"".join(json.dumps(message).encode() + b"\n" for message in messages)


def test_stdout_holds_nothing_but_the_protocol(folder: Path) -> None:
    child = subprocess.Popen(
        [*PRIMRAY, "--root", str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.write(_lines(HELLO))
    child.stdin.flush()
    lines = [child.stdout.readline()]
    child.stdin.write(_lines(INITIALIZED, _call("look", scene="toys.usda", size=64)))
    child.stdin.flush()
    while not any(b'"id":2' in line.replace(b" ", b"") for line in lines):
        lines.append(child.stdout.readline())
    rest, _ = child.communicate(timeout=60)
    assert child.returncode == 0
    for line in [*lines, *rest.splitlines()]:
        assert json.loads(line)["jsonrpc"] == "2.0"
