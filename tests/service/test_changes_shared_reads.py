"""One read for all who ask at once; never one that is older than a change that was told; never an old failure."""

from __future__ import annotations

import asyncio
import threading
import time

from primray_service.changes import SharedReads


def test_reads_are_shared_until_a_change():
    async def scenario() -> None:
        reads, loads = SharedReads(60.0), []

        def load() -> int:
            time.sleep(0.05)
            loads.append(threading.current_thread().name)
            return len(loads)

        assert await asyncio.gather(*(reads.read("a", "x", load) for _ in range(20))) == [1] * 20
        assert await reads.read("a", "x", load) == 1
        assert await asyncio.gather(reads.read("a", "y", load), reads.read("b", "x", load)) in ([2, 3], [3, 2])
        reads.changed("a")
        await asyncio.sleep(0)
        assert await reads.read("a", "x", load) == 4
        assert await reads.read("b", "x", load) in (2, 3)

    asyncio.run(scenario())


def test_a_read_that_a_change_overtook_is_not_kept():
    async def scenario() -> None:
        reads, value, let_go = SharedReads(60.0), ["old"], threading.Event()

        def slow() -> str:
            found = value[0]
            let_go.wait(5)
            return found

        early = asyncio.create_task(reads.read("a", "x", slow))
        await asyncio.sleep(0.05)
        value[0] = "new"
        await asyncio.to_thread(reads.changed, "a")
        await asyncio.sleep(0)
        late = asyncio.create_task(reads.read("a", "x", slow))
        let_go.set()
        assert [await early, await late] == ["old", "new"]
        assert await reads.read("a", "x", slow) == "new"

    asyncio.run(scenario())


def test_a_failure_is_told_to_who_waited_and_forgotten():
    async def scenario() -> None:
        reads = SharedReads(60.0)
        answers: list[str | Exception] = [ValueError("no"), "yes"]

        def load() -> str:
            found = answers.pop(0)
            if isinstance(found, Exception):
                raise found
            return found

        first = await asyncio.gather(*(reads.read("a", "x", load) for _ in range(3)), return_exceptions=True)
        assert [type(one) for one in first] == [ValueError] * 3
        assert await reads.read("a", "x", load) == "yes"

    asyncio.run(scenario())


def test_nothing_is_kept_where_nothing_may_be():
    async def scenario() -> None:
        reads, loads = SharedReads(0.0), []
        for _ in range(3):
            await reads.read("a", "x", lambda: loads.append(1))
        assert len(loads) == 3

    asyncio.run(scenario())


def test_one_who_leaves_takes_nothing_from_the_others():
    async def scenario() -> None:
        reads = SharedReads(60.0)

        def load() -> str:
            time.sleep(0.1)
            return "found"

        leaving, staying = (asyncio.create_task(reads.read("a", "x", load)) for _ in range(2))
        await asyncio.sleep(0.02)
        leaving.cancel()
        assert await staying == "found"

    asyncio.run(scenario())
