"""A node of a real Ray cluster that cheats: its parts are refused, and after the second it gets no more."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

from tests.service.dispatcher.rig import Rig, dispatching
from tests.service.executor.ray.cluster import RunningCluster
from tests.service.executor.ray.test_jobs import LIMITS, SCENE, WAIT_S, pixels

from primray import RenderSettings, render
from primray.images.image import pixels_sha256
from primray_service.executor.local import LocalExecutor
from primray_service.executor.ray.executor import RayExecutor
from primray_service.executor.spot_checks import CheckedExecutor
from primray_service.files import DataDirectory
from primray_service.limits import Limits

SIZE, SAMPLES, JOBS = (64, 48), 96, 8
# What Python runs first on the node that cheats: it changes one sum of each film that it sends.
CHEAT = """
import primray_service.executor.ray.node.chunk_task as task
honest = task.taken

def taken(folder, name, most_bytes):
    if name.endswith(".prc"):
        import numpy
        from primray.checkpoints.checkpoint_file import read_checkpoint, write_checkpoint
        header, arrays = read_checkpoint(folder / name)
        parts = numpy.array(arrays["film.parts"])
        parts[0, 20, 30, 1, 0] += 1 << 40
        (folder / name).unlink()
        write_checkpoint(folder / name, {k: v for k, v in header.items() if k != "arrays"}, {**arrays, "film.parts": parts})
    yield from honest(folder, name, most_bytes)

task.taken = taken
"""


def test_a_node_that_cheats_is_excluded_and_no_picture_has_its_samples(cluster: RunningCluster, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(CHEAT)
    path = os.pathsep.join([str(tmp_path), cluster.environment["PYTHONPATH"]])
    cluster.ask(do="add", number=3, labels={"pool": "lent"}, environment={"PYTHONPATH": path})
    cluster.ask(do="add", number=4, labels={"pool": "lent"})
    made: list[CheckedExecutor] = []

    def make(data: DataDirectory, limits: Limits) -> CheckedExecutor:
        outside = RayExecutor(data, limits, address=cluster.address, labels={"pool": "lent"})
        made.append(CheckedExecutor(outside, LocalExecutor(data, limits, slots=1, cores=1), data, tiles=12))
        return made[0]

    async def act(rig: Rig) -> None:
        checked = made[0]
        await rig.until(lambda: checked.capacity().nodes == 2, WAIT_S)
        for seed in range(JOBS):
            asked = {"resolution": list(SIZE), "seed": seed, "stop": {"max_samples": SAMPLES}}
            job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked, parallel="auto")
            [ended] = await rig.ended(job.id, timeout_s=WAIT_S)
            whole = render(str(SCENE), RenderSettings(resolution=SIZE, seed=seed, adaptive=False, spp=SAMPLES))
            assert pixels(ended) == pixels_sha256(whole.pixels)
            if checked.excluded:
                break
        assert checked.refused == 2
        [excluded] = checked.excluded
        await rig.until(lambda: checked.capacity().nodes == 1, WAIT_S)
        health = checked.health()
        assert health["spot_checks"] == {"tiles": 12, "refused": 2, "excluded": [excluded[:8]]}
        [why] = [node["why"] for node in health["nodes"] if node["id"] == excluded[:8]]
        assert why.startswith("2 of its parts do not have the bits of a render here")
        # It stays so: nothing that it says of itself makes it fit again.
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings={**asked, "seed": 99}, parallel="auto")
        await rig.ended(job.id, timeout_s=WAIT_S)
        assert checked.refused == 2

    async def run() -> None:
        async with dispatching(tmp_path / "server", make, limits=LIMITS) as rig:
            await act(rig)

    try:
        asyncio.run(run())
    finally:
        for number in (3, 4):
            cluster.ask(do="remove", number=number)
