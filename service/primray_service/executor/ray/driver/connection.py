"""Connection to an existing cluster, with clear errors if it fails; and the chunks that all drivers run there."""

from __future__ import annotations

import asyncio
import os
import socket

import ray
from ray.exceptions import AuthenticationError, RayError

from ....jobs import Json
from .. import protocol
from ..link import NotConnected
from ..node.tasks import ask_running, owners

ANSWER_WITHIN_S = 5.0
NO_TOKEN = (
    "there is no token for the Ray cluster: put it into RAY_AUTH_TOKEN, a file that RAY_AUTH_TOKEN_PATH names, "
    "or ~/.ray/auth_token"
)


def connect(address: str) -> None:
    """Connect to a cluster; raises NotConnected with a code of protocol.py. "auto" is the cluster that this machine belongs
    to."""
    if address != "auto":
        _require_listener(*split(address))
    try:
        ray.init(address, log_to_driver=False, configure_logging=False, namespace="primray")
    except AuthenticationError as error:
        why = NO_TOKEN if "no authentication token" in str(error) else str(error)
        raise NotConnected(protocol.WRONG_TOKEN, why) from error
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        raise NotConnected(protocol.UNREACHABLE, f"no Ray cluster at {address}: {_first_line(error)}") from error
    if os.environ.get("RAY_AUTH_MODE") == "disabled":
        print("RAY_AUTH_MODE=disabled: anybody who can reach the Ray cluster can run code on its nodes", flush=True)


def split(address: str) -> tuple[str, int]:
    """Return host and port; raises NotConnected for a malformed address."""
    host, _, port = address.rpartition(":")
    if address.startswith("ray://") or not host or not port.isdigit():
        why = f"{address!r} is not the address of a Ray cluster: write HOST:PORT, or auto on one of its nodes"
        raise NotConnected(protocol.ADDRESS, why)
    return host.strip("[]"), int(port)


def _require_listener(host: str, port: int) -> None:
    """Raise NotConnected unless something listens at the address; Ray itself would retry for two minutes."""
    try:
        socket.create_connection((host, port), ANSWER_WITHIN_S).close()
    except OSError as error:
        why = f"no Ray cluster at {host}:{port}: {error.strerror or error}"
        raise NotConnected(protocol.UNREACHABLE, why) from error


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:500]


OWNERS_WITHIN_S = 5.0


async def what_runs(asking: str) -> list[Json]:
    """Return the running chunks by owner, except those of the asking driver; an owner that does not answer is ending and is
    left out."""
    found = []
    for owner in await asyncio.to_thread(owners):
        if owner == asking:
            continue
        try:
            asked = await asyncio.to_thread(ask_running, owner)
            chunks = await asyncio.wait_for(asyncio.wrap_future(asked.future()), OWNERS_WITHIN_S)
        except (RayError, ValueError, TimeoutError):
            continue
        found.append({"owner": owner, "chunks": chunks})
    return found
