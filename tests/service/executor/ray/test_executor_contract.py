"""The executor on a Ray cluster keeps the contract of all executors."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator

import pytest
from tests.service.executor import contract
from tests.service.executor.contract import ExecutorContract
from tests.service.executor.ray.cluster import RunningCluster

from primray_service.executor.base import Executor, Handle
from primray_service.executor.ray.executor import RayExecutor
from primray_service.files import DataDirectory
from primray_service.limits import GiB, Limits

LONG_S = 300.0  # a node's workers are started when there is work, and have other processes beside them


@pytest.mark.long
class TestRayExecutor(ExecutorContract):
    cluster: RunningCluster

    @pytest.fixture(scope="class")
    @classmethod
    def executor(
        cls, cluster: RunningCluster, loop: asyncio.Runner, tmp_path_factory: pytest.TempPathFactory
    ) -> Iterator[Executor]:
        data = DataDirectory(tmp_path_factory.mktemp("data"))
        cls.cluster = cluster
        patience, contract.LONG_S = contract.LONG_S, LONG_S
        made = RayExecutor(data, Limits(memory_bytes=2 * GiB), address=cluster.address)
        loop.run(made.start())
        yield made
        loop.run(made.close())
        contract.LONG_S = patience

    def shoot(self, handle: Handle, number: int) -> None:
        for pid in self.cluster.workers():
            os.kill(pid, number)
