"""What every executor keeps; test_local_executor.py runs it over ours, and a cluster's will have to pass it as well.

A subclass says how to make one (`make`), and how to kill a chunk's process from outside (`shoot`). Everything runs in one event
loop on the main thread.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.scenes import BROKEN, MISSING_TEXTURE, ROOM, reference_bomb

from primray_service.executor.base import Chunk, Ended, Executor, Handle
from primray_service.worker.preview import read_preview
from primray_service.worker.protocol import LAST

FOREVER = 2**20  # samples: longer than any test
LONG_S = 180.0  # nothing waits so long but what hangs


@dataclass
class Watched:
    """A chunk that runs, and what was heard of it."""

    chunk: Chunk
    heard: list[dict[str, Any]] = field(default_factory=list)
    handle: Handle | None = None
    news: asyncio.Event = field(default_factory=asyncio.Event)

    def hear(self, message: Mapping[str, Any]) -> None:
        self.heard.append(dict(message))
        self.news.set()

    async def until(self, at: str, holds: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        """The first message of a kind, waited for."""
        end = time.monotonic() + LONG_S
        while True:
            for message in self.heard:
                if message["at"] == at and holds(message):
                    return message
            assert not any(m["at"] in LAST for m in self.heard), self.heard[-1]
            self.news.clear()
            await asyncio.wait_for(self.news.wait(), end - time.monotonic())

    async def ended(self) -> Ended:
        assert self.handle is not None
        return await asyncio.wait_for(self.handle.result(), LONG_S)

    def said(self, at: str) -> list[dict[str, Any]]:
        return [message for message in self.heard if message["at"] == at]

    @property
    def last(self) -> dict[str, Any]:
        """Its last word; there must be one, at the end."""
        assert self.heard[-1]["at"] in LAST, self.heard[-1:]
        return self.heard[-1]


class ExecutorContract:
    """`executor` and `loop` are made once a class."""

    @pytest.fixture(scope="class")
    @classmethod
    def loop(cls) -> Iterator[asyncio.Runner]:
        with asyncio.Runner() as runner:
            yield runner

    @pytest.fixture(scope="class")
    @classmethod
    def executor(cls, loop: asyncio.Runner, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Executor]:
        made = cls.make(tmp_path_factory.mktemp("data"))
        loop.run(made.start())
        yield made
        loop.run(made.close())

    @classmethod
    def make(cls, folder: Path) -> Executor:
        """With two slots."""
        raise NotImplementedError

    def shoot(self, handle: Handle, number: int) -> None:
        """Send a signal to the process that does the chunk's work."""
        raise NotImplementedError

    @pytest.fixture
    def scene(self, tmp_path: Path) -> Path:
        path = tmp_path / "upload"
        path.write_text(ROOM)
        return path

    def render(
        self,
        scene: Path,
        *,
        checkpoint: Path | None = None,
        number: int = 0,
        every_s: float = 60.0,
        load_cpu_s: float = 60.0,
        memory_bytes: int | None = None,
        more: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> Chunk:
        command = {
            "do": "render",
            "file": "scene.usda",
            "settings": {"resolution": [96, 64], "spp": 16, **settings},
            "checkpoint": None if checkpoint is None else "checkpoint.prc",
            "number": number,
            "checkpoint_every_s": every_s,
            **(more or {}),
        }
        inputs = {"scene.usda": scene} | ({} if checkpoint is None else {"checkpoint.prc": checkpoint})
        return Chunk("chunk", "render", command, inputs, load_cpu_s=load_cpu_s, memory_bytes=memory_bytes)

    def submit(self, executor: Executor, chunk: Chunk) -> Watched:
        watched = Watched(chunk)
        watched.handle = executor.submit(chunk, watched.hear)
        return watched

    async def run(self, executor: Executor, chunk: Chunk) -> tuple[Watched, Ended]:
        watched = self.submit(executor, chunk)
        return watched, await watched.ended()

    def done(self, watched: Watched, ended: Ended) -> dict[str, Any]:
        """What a chunk that ended well reports; its files are what it says."""
        assert (ended.reason, ended.exit_code, ended.signal) == ("exited", 0, None), ended
        last = watched.last
        assert last["at"] == "done", last
        for output in last["outputs"]:
            data = (ended.folder / output["file"]).read_bytes()
            assert (len(data), hashlib.sha256(data).hexdigest()) == (output["bytes"], output["sha256"])
        report: dict[str, Any] = last["report"]
        return report

    async def undisturbed(self, executor: Executor, scene: Path, **settings: Any) -> str:
        watched, ended = await self.run(executor, self.render(scene, **settings))
        sha256: str = self.done(watched, ended)["pixels_sha256"]
        assert watched.handle is not None
        watched.handle.release()
        return sha256

    def test_a_render_ends_with_outputs(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene))
            report = self.done(watched, ended)
            assert [output["name"] for output in watched.last["outputs"]] == ["beauty.exr", "beauty.png", "report.json"]
            assert report["stop"]["reason"] == "samples"
            assert report["samples_per_pixel"] == [16, 16]
            assert json.loads((ended.folder / "report.json").read_text())["pixels_sha256"] == report["pixels_sha256"]
            preview = read_preview(ended.folder / "preview.raw")
            assert preview.resolution == (96, 64)
            assert preview.samples == 16 * 96 * 64
            assert ended.cpu_s > 0
            assert ended.peak_rss_bytes > 2**20
            assert ended.log_file is not None
            assert ended.log_file.is_file()
            assert watched.handle is not None
            watched.handle.release()

        loop.run(go())

    def test_messages_come_in_order(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene, spp=256, every_s=0.2))
            self.done(watched, ended)
            phases = [message["phase"] for message in watched.said("phase")]
            assert phases == ["opening", "translating", "building", "sampling", "writing"]
            at = [message["at"] for message in watched.heard]
            assert at.index("effective") < at.index("progress") < at.index("preview") < at.index("done")
            numbers = [message["number"] for message in watched.said("checkpoint")]
            assert numbers == list(range(1, len(numbers) + 1))
            fractions = [message["fraction"] for message in watched.said("progress")]
            assert fractions == sorted(fractions)
            assert fractions[-1] == 1
            samples = [message["samples"] for message in watched.said("row")]
            assert samples == sorted(set(samples))
            passes = [message["pass"] for message in watched.said("preview")]
            assert passes == sorted(set(passes))
            assert [message for message in watched.heard if message["at"] in LAST] == [watched.last]

        loop.run(go())

    def test_a_killed_chunk_says_nothing_more(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched = self.submit(executor, self.render(scene, spp=FOREVER))
            await watched.until("preview")
            assert watched.handle is not None
            start = time.monotonic()
            watched.handle.kill()
            ended = await watched.ended()
            assert time.monotonic() - start < 10  # of a render without end
            assert ended.reason == "killed"
            assert not any(message["at"] in LAST for message in watched.heard)
            assert (ended.folder / "preview.raw").is_file()
            watched.handle.release()

        loop.run(go())

    def test_a_stopped_chunk_leaves_its_picture(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched = self.submit(executor, self.render(scene, spp=FOREVER))
            await watched.until("preview")
            assert watched.handle is not None
            start = time.monotonic()
            watched.handle.tell({"do": "stop"})
            ended = await watched.ended()
            took = time.monotonic() - start
            report = self.done(watched, ended)
            assert report["interrupted"]
            assert report["samples"] > 0
            assert watched.said("checkpoint")
            assert len(watched.last["outputs"]) == 3
            assert took < 10  # on a machine under load; a fraction of a second otherwise

        loop.run(go())

    def test_stopped_before_it_has_a_picture(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched = self.submit(executor, self.render(scene, spp=FOREVER))
            assert watched.handle is not None
            watched.handle.tell({"do": "stop"})
            ended = await watched.ended()
            report = self.done(watched, ended)
            assert report["interrupted"]
            assert watched.last["outputs"] == [] or report["samples"] > 0

        loop.run(go())

    def test_told_to_yield_before_it_samples(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched = self.submit(executor, self.render(scene, spp=FOREVER))
            assert watched.handle is not None
            watched.handle.tell({"do": "yield"})
            await watched.ended()
            assert watched.last["at"] == "yielded"

        loop.run(go())

    @pytest.mark.parametrize("settings", [{"spp": 1000}, {"spp": 2000, "target_error": 2e-8}], ids=["samples", "target"])
    def test_yielded_and_resumed_the_bits_are_the_same(
        self, executor: Executor, loop: asyncio.Runner, scene: Path, tmp_path: Path, settings: dict[str, Any]
    ) -> None:
        async def go() -> None:
            expected = await self.undisturbed(executor, scene, **settings)
            checkpoint: Path | None = None
            number = runs = 0
            while True:
                runs += 1
                watched = self.submit(executor, self.render(scene, checkpoint=checkpoint, number=number, **settings))
                if runs < 4:
                    await watched.until("preview")
                    assert watched.handle is not None
                    watched.handle.tell({"do": "yield"})
                ended = await watched.ended()
                if watched.last["at"] == "done":
                    break
                number, checkpoint = self.checkpoint_of(watched, ended, tmp_path)
                assert watched.last == {"at": "yielded", "number": number}
            assert runs >= 3
            assert self.done(watched, ended)["pixels_sha256"] == expected

        loop.run(go())

    def checkpoint_of(self, watched: Watched, ended: Ended, tmp_path: Path) -> tuple[int, Path]:
        """The last one, taken out of the chunk's folder, which is released."""
        last = watched.said("checkpoint")[-1]
        kept = tmp_path / f"kept-{last['number']}.prc"
        (ended.folder / last["file"]).rename(kept)
        assert watched.handle is not None
        watched.handle.release()
        return last["number"], kept

    def test_killed_from_outside_and_resumed_the_bits_are_the_same(
        self, executor: Executor, loop: asyncio.Runner, scene: Path, tmp_path: Path
    ) -> None:
        async def go() -> None:
            expected = await self.undisturbed(executor, scene, spp=1000)
            watched = self.submit(executor, self.render(scene, spp=1000, every_s=0.05))
            await watched.until("checkpoint")
            assert watched.handle is not None
            self.shoot(watched.handle, signal.SIGKILL)
            ended = await watched.ended()
            assert (ended.reason, ended.signal) == ("signal", signal.SIGKILL)
            saved = watched.said("checkpoint")[-1]["samples"]
            number, checkpoint = self.checkpoint_of(watched, ended, tmp_path)
            watched, ended = await self.run(executor, self.render(scene, spp=1000, checkpoint=checkpoint, number=number))
            assert watched.said("progress")[0]["samples_done"] >= saved > 0
            assert self.done(watched, ended)["pixels_sha256"] == expected
            assert watched.said("checkpoint")[0]["number"] == number + 1

        loop.run(go())

    def test_extended_from_its_checkpoint(self, executor: Executor, loop: asyncio.Runner, scene: Path, tmp_path: Path) -> None:
        async def go() -> None:
            expected = await self.undisturbed(executor, scene, spp=48)
            watched, ended = await self.run(executor, self.render(scene, spp=16))
            self.done(watched, ended)
            number, checkpoint = self.checkpoint_of(watched, ended, tmp_path)
            watched, ended = await self.run(executor, self.render(scene, spp=48, checkpoint=checkpoint, number=number))
            assert self.done(watched, ended)["pixels_sha256"] == expected

        loop.run(go())

    def test_a_picture_of_a_checkpoint(self, executor: Executor, loop: asyncio.Runner, scene: Path, tmp_path: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene, spp=16))
            expected = self.done(watched, ended)["pixels_sha256"]
            number, checkpoint = self.checkpoint_of(watched, ended, tmp_path)
            chunk = self.render(scene, spp=FOREVER, checkpoint=checkpoint, number=number, more={"picture_only": True})
            watched, ended = await self.run(executor, chunk)
            report = self.done(watched, ended)
            assert report["pixels_sha256"] == expected
            assert report["samples_per_pixel"] == [16, 16]

        loop.run(go())

    def test_time_that_is_spent_counts(self, executor: Executor, loop: asyncio.Runner, scene: Path, tmp_path: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene, spp=None, time_limit_s=0.5))
            assert self.done(watched, ended)["stop"]["reason"] == "time-limit"
            number, checkpoint = self.checkpoint_of(watched, ended, tmp_path)
            spent = {"spent_s": 29.8}
            chunk = self.render(scene, spp=None, time_limit_s=30.0, checkpoint=checkpoint, number=number, more=spent)
            watched, ended = await self.run(executor, chunk)
            report = self.done(watched, ended)
            assert report["stop"]["reason"] == "time-limit"
            assert 0.4 < report["sampling_s"] < 20

        loop.run(go())

    def test_a_crash_is_a_signal(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched = self.submit(executor, self.render(scene, spp=FOREVER))
            await watched.until("phase", lambda message: message["phase"] == "sampling")
            assert watched.handle is not None
            self.shoot(watched.handle, signal.SIGSEGV)
            ended = await watched.ended()
            assert (ended.reason, ended.signal, ended.exit_code) == ("signal", signal.SIGSEGV, None)

        loop.run(go())

    def test_two_at_once_have_the_same_bits(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            assert executor.capacity().slots >= 2
            both = [self.submit(executor, self.render(scene, spp=200)) for _ in range(2)]
            await asyncio.gather(*(watched.until("preview") for watched in both))
            reports = [self.done(watched, await watched.ended()) for watched in both]
            assert reports[0]["pixels_sha256"] == reports[1]["pixels_sha256"]
            folders = {watched.handle.folder for watched in both if watched.handle}
            assert len(folders) == 2

        loop.run(go())

    def test_what_comes_late_does_nothing(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene))
            before = len(watched.heard)
            assert watched.handle is not None
            for command in ({"do": "stop"}, {"do": "yield"}, {"do": "preview"}):
                watched.handle.tell(command)
            watched.handle.kill()
            assert await watched.ended() == ended
            assert len(watched.heard) == before
            assert (ended.folder / "beauty.exr").is_file()
            watched.handle.release()
            watched.handle.release()
            for _ in range(100):
                if not ended.folder.exists():
                    return
                await asyncio.sleep(0.05)
            pytest.fail("its files are still there")

        loop.run(go())

    def test_previews_are_made_when_asked_for(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched = self.submit(executor, self.render(scene, spp=FOREVER))
            first = await watched.until("preview")
            await asyncio.sleep(1.2)
            assert watched.said("preview") == [first]
            assert watched.handle is not None
            watched.handle.tell({"do": "preview"})
            later = await watched.until("preview", lambda message: message["pass"] > first["pass"])
            shown = read_preview(watched.handle.folder / later["file"])
            assert shown.samples >= later["samples"]
            watched.handle.kill()
            await watched.ended()

        loop.run(go())

    def test_a_layer_that_cannot_be_read(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            scene.write_text(BROKEN)
            watched, ended = await self.run(executor, self.render(scene))
            assert ended.exit_code == 0
            problem = watched.last["problem"]
            assert problem["type"] == "/problems/layer-unreadable"
            assert problem["layer"] == "scene.usda"
            assert problem["line"] in (4, 5, 6)
            assert "secret" not in json.dumps(watched.heard)
            assert "Traceback" not in json.dumps(watched.heard)

        loop.run(go())

    def test_warnings_and_strictness(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            scene.write_text(MISSING_TEXTURE)
            watched, ended = await self.run(executor, self.render(scene))
            self.done(watched, ended)
            [warning] = [message for message in watched.said("warning") if message["code"] == "asset-missing"]
            assert warning["prim"] == "/World/sky"
            assert (warning["severity"], warning["kind"]) == ("error", "missing")
            assert "attribute" in warning
            watched, _ = await self.run(executor, self.render(scene, strict=True))
            assert watched.last["problem"]["type"] == "/problems/strict-warnings"

        loop.run(go())

    def test_settings_that_the_scene_does_not_allow(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched, _ = await self.run(executor, self.render(scene, camera="/not/there"))
            assert watched.last["problem"]["type"] == "/problems/settings-rejected"

        loop.run(go())

    def test_another_pictures_checkpoint(self, executor: Executor, loop: asyncio.Runner, scene: Path, tmp_path: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene))
            number, checkpoint = self.checkpoint_of(watched, ended, tmp_path)
            chunk = self.render(scene, checkpoint=checkpoint, number=number, seed=7)
            watched, _ = await self.run(executor, chunk)
            assert watched.last["problem"]["type"] == "/problems/checkpoint-unusable"

        loop.run(go())

    def test_more_memory_than_is_allowed(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            watched, ended = await self.run(executor, self.render(scene, spp=FOREVER, memory_bytes=50 * 2**20))
            assert ended.reason == "memory-limit" or watched.last["problem"]["type"] == "/problems/memory-limit"

        loop.run(go())

    def test_a_scene_that_takes_forever_to_open(self, executor: Executor, loop: asyncio.Runner, scene: Path) -> None:
        async def go() -> None:
            scene.write_text(reference_bomb())
            start = time.monotonic()
            _, ended = await self.run(executor, self.render(scene, load_cpu_s=1.0))
            assert ended.reason in ("time-limit", "memory-limit")
            assert ended.cpu_s >= 1
            assert time.monotonic() - start < 30

        loop.run(go())
