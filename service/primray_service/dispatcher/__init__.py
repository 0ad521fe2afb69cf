"""The dispatcher: holds the lease, gives frames to the executor, adopts what comes back."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..executor.base import Executor
    from ..files import DataDirectory
    from ..limits import Limits, Quotas
    from ..store.base import Store


class Dispatcher:
    """One a server; those of several servers take turns by the store's lease."""

    def __init__(
        self,
        store: Store,
        executor: Executor,
        data: DataDirectory,
        limits: Limits,
        quotas_of: Callable[[str], Quotas],
    ) -> None:
        raise NotImplementedError

    async def run(self) -> None:
        """Until `stop`: hold the lease when it can be had, and work."""
        raise NotImplementedError

    def wake(self) -> None:
        """Something was queued or is to be canceled; from any thread."""
        raise NotImplementedError

    def ask_preview(self, job_id: str, frame: int) -> None:
        """Somebody looks at this frame: its worker is to write previews; from any thread."""
        raise NotImplementedError

    async def stop(self) -> None:
        """Let running frames write a checkpoint (a few seconds), queue them again, and release the lease."""
        raise NotImplementedError
