"""The executor on this machine: the contract, and what only processes and folders here have."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tests.service.executor.contract import ExecutorContract

from primray_service.executor.base import Executor, Handle
from primray_service.executor.local import LocalExecutor
from primray_service.executor.local_worker import Run, SandboxLayers
from primray_service.executor.process import innermost
from primray_service.files import DataDirectory
from primray_service.limits import GiB, Limits


class TestLocalExecutor(ExecutorContract):
    @classmethod
    def make(cls, folder: Path) -> Executor:
        return LocalExecutor(DataDirectory(folder), Limits(memory_bytes=2 * GiB), slots=2, cores=2)

    def shoot(self, handle: Handle, number: int) -> None:
        assert isinstance(handle, Run)
        os.kill(innermost(handle.pid), number)


@pytest.mark.long
class TestWithoutBubblewrap(TestLocalExecutor):
    """The same where namespaces are not to be had."""

    @classmethod
    def make(cls, folder: Path) -> Executor:
        walls = SandboxLayers(frozenset({"rlimits", "landlock", "seccomp"}))
        return LocalExecutor(DataDirectory(folder), Limits(memory_bytes=2 * GiB), slots=2, cores=2, sandbox_layers=walls)


@pytest.mark.long
class TestWithoutWarmWorkers(TestLocalExecutor):
    @classmethod
    def make(cls, folder: Path) -> Executor:
        return LocalExecutor(DataDirectory(folder), Limits(memory_bytes=2 * GiB), slots=2, cores=2, warm=False)
