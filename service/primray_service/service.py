"""The parts of a running server, by the names that routes use."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from .config import ServeConfig
from .files import DataDirectory
from .limits import Limits, Quotas
from .pictures.encoder import PictureEncoder

if TYPE_CHECKING:
    from .changes import Changes
    from .dispatcher import Dispatcher
    from .executor.base import Executor
    from .sandbox import SelfTest
    from .shared_reads import SharedReads
    from .store.base import Store


@dataclass
class Service:
    config: ServeConfig
    store: Store
    data: DataDirectory
    executor: Executor
    dispatcher: Dispatcher
    changes: Changes  # who waits for a change of a job
    reads: SharedReads  # of jobs that many ask for at once
    self_test: SelfTest | None = None  # of the sandbox, at the start; None: this server runs no workers
    pictures: PictureEncoder = field(default_factory=PictureEncoder)

    @property
    def limits(self) -> Limits:
        return self.config.limits

    @property
    def quotas(self) -> Quotas:
        return self.config.quotas
