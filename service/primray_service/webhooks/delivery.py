"""One attempt to deliver a webhook: resolve the name, check every address it has, connect to one of exactly those, send, read a
little.

No redirects, no proxies and no environment variables are used, and of the answer only the status is kept.
"""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import httpx2

from primray import __version__

from ..config import ServeConfig
from ..http.retry_after import retry_after_s
from ..problems import Problem
from ..store.base import WebhookDelivery
from .addresses import Resolve, Target
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
