"""Webhooks of job requests, and the addresses they may call: public ones, and those in networks that the configuration opens.

A name is resolved when a job is submitted, for an immediate error, and again for each attempt, which connects to the very
address that was resolved and checked then; so changes in between (DNS rebinding) do not matter.
"""

from __future__ import annotations

import ipaddress
import socket
import threading
from collections.abc import Callable, Sequence

from ..api.models import Webhook
from ..config import ServeConfig
from ..jobs import Json
from ..problems import Problem
from .signing import key_of, new_secret

# Returns addresses in the order of the system's resolver; OSError (socket.gaierror) if there are none.
Resolve = Callable[[str, int], Sequence[str]]
Address = ipaddress.IPv4Address | ipaddress.IPv6Address

LOOK_UP_S = 3.0
LONGEST_URL = 2048

# https://www.iana.org/assignments/iana-ipv4-special-registry, -ipv6-special-registry: addresses that are not globally
# reachable, or reach IPv4 in another way (6to4, Teredo). Metadata services are in 169.254.0.0/16, 100.64.0.0/10 and fc00::/7;
# 168.63.129.16 is Azure's, a public number that each of its machines sees as its own host.
_CLOSED_4 = tuple(
    ipaddress.IPv4Network(text)
    for text in [
        "0.0.0.0/8",
        "10.0.0.0/8",
        "100.64.0.0/10",
        "127.0.0.0/8",
        "168.63.129.16/32",
        "169.254.0.0/16",
        "172.16.0.0/12",
        "192.0.0.0/24",
        "192.0.2.0/24",
        "192.31.196.0/24",
        "192.52.193.0/24",
        "192.88.99.0/24",
        "192.168.0.0/16",
        "192.175.48.0/24",
        "198.18.0.0/15",
        "198.51.100.0/24",
        "203.0.113.0/24",
        "224.0.0.0/4",
        "240.0.0.0/4",
    ]
)
_OPEN_6 = ipaddress.IPv6Network("2000::/3")  # the part of IPv6 that is allocated so far
_CLOSED_6 = tuple(
    ipaddress.IPv6Network(text) for text in ["2001::/23", "2001:db8::/32", "2002::/16", "2620:4f:8000::/48", "3fff::/20"]
)


def is_public(address: Address) -> bool:
    if isinstance(address, ipaddress.IPv4Address):
        return not any(address in network for network in _CLOSED_4)
    return address in _OPEN_6 and not any(address in network for network in _CLOSED_6)


def may_be_called(text: str, networks: Sequence[str]) -> bool:
    """Return whether an address is public, or in one of the opened networks; an IPv4 address mapped into IPv6 counts as
    IPv4."""
    address = ipaddress.ip_address(text)
    if isinstance(address, ipaddress.IPv6Address):
        if address.scope_id is not None:
            return False
        address = address.ipv4_mapped or address
    opened = (ipaddress.ip_network(network) for network in networks)
    return is_public(address) or any(address in network for network in opened)


def resolve_now(host: str, port: int) -> Sequence[str]:
    """Resolve by the system's resolver, however long that takes."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_ADDRCONFIG)
    return list(dict.fromkeys(str(sockaddr[0]) for *_, sockaddr in found))


class Target:
    """The parts of a webhook's URL that decide where a request goes; Problem if it cannot be called."""

    def __init__(self, text: str, http_is_allowed: bool) -> None:
        # Imported late: slow, and needed only for jobs with webhooks.
        import httpx2

        if len(text) > LONGEST_URL:
            raise _refused(f"The address is longer than {LONGEST_URL} characters.")
        try:
            self.url = httpx2.URL(text)
        except (httpx2.InvalidURL, ValueError) as error:
            raise _refused(f"The address is not a URL: {error}") from None
        schemes = ("https", "http") if http_is_allowed else ("https",)
        if self.url.scheme not in schemes:
            raise _refused(f"The address must start with {' or '.join(f'{scheme}://' for scheme in schemes)}.")
        if self.url.userinfo:
            raise _refused("The address contains a user name or password; receivers authenticate calls by their signature.")
        self.host = self.url.raw_host.decode("ascii")
        if not self.host:
            raise _refused("The address has no host.")
        self.port = {"https": 443, "http": 80}[self.url.scheme] if self.url.port is None else self.url.port
        if not 0 < self.port < 65536:
            raise _refused("The address has an invalid port.")

    def closed_among(self, addresses: Sequence[str], networks: Sequence[str]) -> str | None:
        """Return the first address that may not be called: one is enough to refuse a name."""
        return next((address for address in addresses if not may_be_called(address, networks)), None)


def check_address(text: str, config: ServeConfig, resolve: Resolve = resolve_now) -> None:
    """Raise Problem("webhook-address") unless it may be called. Resolving may take LOOK_UP_S, so call it in a thread.

    A name that cannot be resolved now is accepted: each attempt resolves it again.
    """
    target = Target(text, config.webhook_http)
    try:
        addresses = _looked_up(target, resolve)
    except socket.gaierror as error:
        if error.errno in (socket.EAI_AGAIN, socket.EAI_FAIL, socket.EAI_SYSTEM):
            return
        raise _refused(f"There is no host named {target.host}.") from None
    except (OSError, UnicodeError):
        raise _refused(f"There is no host named {target.host}.") from None
    if addresses is not None and target.closed_among(addresses, config.webhook_networks):
        # The message does not reveal which address the name has inside the server's network.
        raise _refused(
            f"{target.host} is not on the public internet, or is reserved; this server does not call such addresses."
        )


def _looked_up(target: Target, resolve: Resolve) -> Sequence[str] | None:
    """Resolve a name; None if it took too long: the system's resolver cannot be interrupted."""
    found: list[Sequence[str] | BaseException] = []

    def look() -> None:
        try:
            found.append(resolve(target.host, target.port))
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=look, name="webhook address", daemon=True)
    thread.start()
    thread.join(LOOK_UP_S)
    if not found:
        return None
    if isinstance(found[0], BaseException):
        raise found[0]
    return found[0]


def _refused(detail: str) -> Problem:
    return Problem("webhook-address", detail)


def accepted_webhook(webhook: Webhook, config: ServeConfig, resolve: Resolve = resolve_now) -> Json:
    """Return the webhook to store: with a secret, made if none was given. Problem if it cannot be called. Call it in a thread:
    it resolves a name."""
    check_address(webhook.url, config, resolve)
    if webhook.secret is not None:
        try:
            key_of(webhook.secret)
        except ValueError as error:
            raise Problem("invalid-request", str(error), errors=[{"at": "/webhook/secret", "detail": str(error)}]) from None
    return {"url": webhook.url, "events": list(webhook.events), "secret": webhook.secret or new_secret()}


def shown_webhook(kept: Json, *, with_secret: bool = False) -> Json:
    """Return a stored webhook as clients see it; the secret only in the answer to the request that made it."""
    return {name: value for name, value in kept.items() if name != "secret" or with_secret}
