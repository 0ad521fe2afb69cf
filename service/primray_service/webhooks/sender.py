"""Delivery of due webhooks in a loop: run by the server that holds the lease, beside its dispatcher.

Delivery is at least once: an attempt whose result could not be stored is repeated; receivers recognise it by its webhook-id.
Slow receivers delay only their own calls: the number of concurrent calls to one host is bounded.

An attempt resolves the name, checks every address it has, connects to one of exactly those, sends, and reads a little. No
redirects, no proxies and no environment variables are used, and of the answer only the status is kept.
"""

from __future__ import annotations

import asyncio
import json
import random
import ssl
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal
from urllib.parse import urlsplit

import httpx2
import structlog

from primray import __version__

from ..config import ServeConfig
from ..http.retry_after import retry_after_s
from ..problems import Problem
from ..store.base import Lost, Store, WebhookDelivery
from .addresses import Resolve, Target, resolve_now
from .signing import signed_headers

TIMEOUT_S = 10.0  # in total: resolve, connect, send, read
CONNECT_S = 4.0  # for one address, before the next is tried
ADDRESSES = 3
MOST_READ = 4096
USER_AGENT = f"primray/{__version__} (webhooks)"


@dataclass(frozen=True)
class Outcome:
    """Result. `hopeless`: another attempt is useless. `wait_s`: the delay that the receiver asked for."""

    state: Literal["delivered", "undelivered", "hopeless"]
    error: str = ""
    wait_s: float | None = None


class _Closed(Exception):
    pass


async def deliver(
    delivery: WebhookDelivery,
    now: float,
    config: ServeConfig,
    resolve: Resolve,
    tls: ssl.SSLContext,
    timeout_s: float = TIMEOUT_S,
) -> Outcome:
    """Make one attempt; never raises for what the receiver, the network or the address does."""
    try:
        target = Target(delivery.url, config.webhook_http)
        body = json.dumps(delivery.payload, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
        headers = signed_headers(delivery.secret, delivery.id, int(now), body)
        async with asyncio.timeout(timeout_s):
            addresses = await _addresses(target, config.webhook_networks, resolve)
            return await _send(target, addresses, headers, body, tls, now)
    except (Problem, _Closed) as error:
        return Outcome("hopeless", error.detail if isinstance(error, Problem) else str(error))
    except TimeoutError:
        return Outcome("undelivered", f"no answer within {timeout_s:g} s")
    except (httpx2.HTTPError, OSError) as error:
        return Outcome("undelivered", _reason(error))
    except ValueError as error:  # a secret or payload that cannot be sent, an invalid header
        return Outcome("hopeless", _reason(error))


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"[:300]


async def _addresses(target: Target, networks: Sequence[str], resolve: Resolve) -> Sequence[str]:
    addresses = await asyncio.to_thread(resolve, target.host, target.port)
    if not addresses:
        raise OSError(f"{target.host} has no address")
    if target.closed_among(addresses, networks):
        raise _Closed(f"{target.host} is not on the public internet, or is reserved")
    return addresses[:ADDRESSES]


async def _send(
    target: Target, addresses: Sequence[str], headers: dict[str, str], body: bytes, tls: ssl.SSLContext, now: float
) -> Outcome:
    """Send to the first address that accepts a connection; the certificate must be the name's."""
    headers = headers | {
        "Host": target.url.netloc.decode("ascii"),
        "Content-Type": "application/json",
        "User-Agent": USER_AGENT,
        "Accept-Encoding": "identity",
    }
    timeout = httpx2.Timeout(TIMEOUT_S, connect=CONNECT_S)
    async with httpx2.AsyncClient(verify=tls, trust_env=False, follow_redirects=False, timeout=timeout) as client:
        for place, address in enumerate(addresses, 1):
            url = target.url.copy_with(host=address, fragment=None)
            try:
                async with client.stream(
                    "POST", url, content=body, headers=headers, extensions={"sni_hostname": target.host}
                ) as response:
                    await _read_a_little(response)
                    return _outcome(response, now)
            except (httpx2.ConnectError, httpx2.ConnectTimeout):
                if place == len(addresses):
                    raise
    raise AssertionError("there is at least one address")


async def _read_a_little(response: httpx2.Response) -> None:
    """Read enough for a well-behaved receiver to finish its answer; without decompression."""
    read = 0
    async for part in response.aiter_raw():
        read += len(part)
        if read >= MOST_READ:
            return


def _outcome(response: httpx2.Response, now: float) -> Outcome:
    status = response.status_code
    if 200 <= status < 300:
        return Outcome("delivered")
    if status == 410:  # "no longer interested in receiving webhooks from this source"
        return Outcome("hopeless", "the receiver answered 410 Gone")
    moved = "; redirects are not followed" if 300 <= status < 400 else ""
    return Outcome("undelivered", f"the receiver answered {status}{moved}", retry_after_s(response.headers, now))


# Delays between attempts; the first is made at once. The Standard Webhooks specification's example, without the last two.
DELAYS_S: tuple[float, ...] = (5, 5 * 60, 30 * 60, 2 * 3600, 5 * 3600, 10 * 3600, 14 * 3600)
JITTER = 0.2  # random extension of a delay, as a fraction at most
LONGEST_WAIT_S = 24 * 3600.0  # longest delay that a receiver may ask for
LOOK_EVERY_S = 1.0
AT_A_TIME = 32
AT_A_TIME_TO_A_HOST = 4
LOOK_AT = 500  # due deliveries that are searched for idle hosts
STOP_GRACE_S = 2.0

_log = structlog.get_logger("primray.webhooks")


class WebhookSender:
    """The sender. `run` lasts until `stop`; call `wake` in the event loop when something became due."""

    def __init__(
        self,
        store: Store,
        config: ServeConfig,
        *,
        resolve: Resolve = resolve_now,
        tls: ssl.SSLContext | None = None,
        delays_s: Sequence[float] = DELAYS_S,
        timeout_s: float = TIMEOUT_S,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._store = store
        self._config = config
        self._resolve = resolve
        self._tls = tls
        self._delays_s = tuple(delays_s)
        self._timeout_s = timeout_s
        self._clock = clock
        self._woken = asyncio.Event()
        self._stopping = False
        self._tries: dict[str, asyncio.Task[None]] = {}  # by delivery id
        self._hosts: Counter[str] = Counter()
        self._ended: set[str] = set()  # since the last read of the store, which may be older than their end

    async def run(self, fence: Callable[[], int | None]) -> None:
        """Deliver until stopped. `fence`: of the lease that this server holds now, or None."""
        while not self._stopping:
            held = fence()
            if held is not None:
                try:
                    await self._start_due(held)
                except Lost:
                    pass
                except Exception as error:  # the database is away: retry, as the dispatcher does
                    _log.warning("webhooks_not_read", error=f"{type(error).__name__}: {error}"[:300])
            self._woken.clear()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._woken.wait(), LOOK_EVERY_S)
        if self._tries:
            _, late = await asyncio.wait(self._tries.values(), timeout=STOP_GRACE_S)
            for task in late:
                task.cancel()
            await asyncio.gather(*late, return_exceptions=True)

    def wake(self) -> None:
        self._woken.set()

    async def stop(self) -> None:
        """Stop: no new attempts; running ones have STOP_GRACE_S. `run` then returns."""
        self._stopping = True
        self._woken.set()

    async def _start_due(self, fence: int) -> None:
        if len(self._tries) >= AT_A_TIME:
            return
        now = self._clock()
        self._ended.clear()
        due = await asyncio.to_thread(self._store.due_webhooks, fence, now, LOOK_AT)
        for delivery in due:
            if len(self._tries) >= AT_A_TIME:
                return
            host = urlsplit(delivery.url).netloc
            is_known = delivery.id in self._tries or delivery.id in self._ended
            if not is_known and self._hosts[host] < AT_A_TIME_TO_A_HOST and not self._stopping:
                self._hosts[host] += 1
                self._tries[delivery.id] = asyncio.create_task(self._try(fence, delivery, host))

    async def _try(self, fence: int, delivery: WebhookDelivery, host: str) -> None:
        try:
            now = self._clock()
            if self._tls is None:
                self._tls = await asyncio.to_thread(_default_tls)
            outcome = await deliver(delivery, now, self._config, self._resolve, self._tls, self._timeout_s)
            state, next_at = self._decided(delivery, outcome)
            await asyncio.to_thread(
                self._store.webhook_tried, fence, delivery.id, state=state, next_at=next_at, error=outcome.error
            )
            tell = _log.info if state == "delivered" else _log.warning
            tell(
                "webhook",
                job_id=delivery.job_id,
                webhook_id=delivery.id,
                tries=delivery.tries + 1,
                state=state,
                error=outcome.error,
            )
        except Lost:
            pass  # the next holder tries again
        except Exception as error:
            _log.warning("webhook_not_noted", webhook_id=delivery.id, error=f"{type(error).__name__}: {error}"[:300])
            await asyncio.sleep(LOOK_EVERY_S)  # it is still due, and must not be sent over and over
        finally:
            self._ended.add(delivery.id)
            del self._tries[delivery.id]
            self._hosts[host] -= 1
            if not self._hosts[host]:
                del self._hosts[host]
            self._woken.set()

    def _decided(self, delivery: WebhookDelivery, outcome: Outcome) -> tuple[str, float]:
        """Return the delivery's next state, and the time of its next attempt."""
        now = self._clock()
        if outcome.state == "delivered":
            return "delivered", now
        if outcome.state == "hopeless" or delivery.tries >= len(self._delays_s):
            return "failed", now
        delay = self._delays_s[delivery.tries] * (1 + JITTER * random.random())
        return "due", now + max(delay, min(outcome.wait_s or 0.0, LONGEST_WAIT_S))


def _default_tls() -> ssl.SSLContext:
    """Return a TLS context with the system's certificates; cached, since loading is slow."""
    import httpx2

    return httpx2.create_ssl_context(trust_env=False)
