"""Holding the store's lease: its holder dispatches. A holder that could not renew it in time stops before another can begin, by
the monotonic clock, which nobody adjusts; expiry is judged by the database's clock, which all servers share."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from ..jobs import Json
from ..store.base import Lost, Store

TTL_S = 5.0
RENEW_EVERY_S = 1.5
TRY_AGAIN_S = 0.25
MARGIN_S = 0.5  # work is stopped this long before the lease expires

LOG = logging.getLogger(__name__)


class Lease:
    """One hold of the lease, from `acquire` until `keep` returns."""

    def __init__(self, store: Store, holder: str, about: Callable[[], Json] = dict) -> None:
        self._store = store
        self._holder = holder
        self._about = about  # what other servers are told about the holder
        # Renewals have a thread of their own, so that they do not wait for other calls.
        self._thread = ThreadPoolExecutor(1, "dispatcher-lease")
        self._until = 0.0
        self._reached_at = 0.0
        self._given_up: int | None = None  # fence that may still be the store's
        self.fence: int | None = None

    @property
    def is_held(self) -> bool:
        return self.fence is not None and time.monotonic() < self._until - MARGIN_S

    def was_reached_since(self, moment: float) -> bool:
        """Return whether the database answered a renewal that began after this moment of the monotonic clock."""
        return self._reached_at > moment

    async def acquire(self) -> bool:
        """Return whether the lease is ours now; raises the database's exceptions."""
        if self._given_up is not None:
            self.fence, self._given_up = self._given_up, None
            await self.release()
        asked = time.monotonic()
        loop = asyncio.get_running_loop()
        fence = await loop.run_in_executor(self._thread, self._acquire, self._about())
        if fence is None:
            return False
        self.fence, self._until, self._reached_at = fence, asked + TTL_S, asked
        if not self.is_held:  # the answer took too long
            self.fence = None
            return False
        return True

    async def keep(self) -> None:
        """Renew the lease, and return when it is lost."""
        pause = RENEW_EVERY_S
        while True:
            await asyncio.sleep(min(pause, max(self._left(), 0.0)))
            if not self.is_held:
                self._given_up = self.fence
                break
            pause = RENEW_EVERY_S if await self._renewed() else TRY_AGAIN_S
            if self.fence is None:
                break
        self.fence = None

    def _left(self) -> float:
        return self._until - MARGIN_S - time.monotonic()

    async def _renewed(self) -> bool:
        assert self.fence is not None
        asked = time.monotonic()
        loop = asyncio.get_running_loop()
        renewal = loop.run_in_executor(self._thread, self._renew, self.fence, self._about())
        try:
            await asyncio.wait_for(renewal, max(self._left(), 0.0))
        except Lost:
            LOG.warning("another server holds the lease now")
            self.fence = None
        except TimeoutError:
            LOG.warning("the lease could not be renewed in time")
            self.fence, self._given_up = None, self.fence
        except Exception as error:
            LOG.warning("the lease was not renewed: %r", error)
        else:
            self._until, self._reached_at = asked + TTL_S, asked
            return True
        return False

    def _acquire(self, about: Json) -> int | None:
        return self._store.acquire_lease(self._holder, self._store.clock(), TTL_S, about)

    def _renew(self, fence: int, about: Json) -> None:
        self._store.renew_lease(fence, self._store.clock(), TTL_S, about)

    async def release(self) -> None:
        """Release the lease for another server; a failure does no harm, as the lease expires."""
        fence, self.fence = self.fence, None
        if fence is None:
            return
        loop = asyncio.get_running_loop()
        try:
            await asyncio.wait_for(loop.run_in_executor(self._thread, self._store.release_lease, fence), TTL_S)
        except Exception as error:
            LOG.warning("the lease was not released: %r", error)

    def close(self) -> None:
        self._thread.shutdown(wait=False)
