"""Everything that Ray is asked to run on nodes. Functions of modules are sent by name, so a node must have the same primray.

The driver's mailbox is an actor beside it: running chunks poll it for the server's commands with a blocking call, and it
knows what runs where.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from typing import Any

import ray
import ray.util
from ray.exceptions import RayError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from ....jobs import Json
from . import chunk_task
from .fitness import Fitness, fitness
from .transfer import Item, Order, Wanted

MOST_AHEAD = 16  # items of a task that nobody has taken yet: results must not fill the object store
MOST_ASKING = 1000  # chunks that wait for commands
MAILBOX = "mailbox-"  # prefix of its name


def _run_chunk(order: Order, mailbox: Any) -> Iterator[list[Item]]:
    def take() -> list[Json] | None:
        try:
            letters: list[Json] | None = ray.get(mailbox.take.remote(order.key))
        except RayError:  # it is gone; Ray starts it again, or ends this process too
            return None
        return letters

    yield from chunk_task.run(order, ray.get_runtime_context().get_node_id(), ray.get, take)


def _fitness_of_node(wanted: Wanted) -> Fitness:
    return fitness(wanted)


@cache
def _remote(function: Callable[..., Any]) -> Any:
    """Return the function registered with Ray, which happens once."""
    return ray.remote(function)


def give_chunk(order: Order, mailbox: Any, resources: Mapping[str, Any], labels: Mapping[str, str]) -> Any:
    """Return the task, whose items are lists of Item. Ray does not retry it: the dispatcher does."""
    given = _remote(_run_chunk).options(
        **resources,
        label_selector=dict(labels),
        scheduling_strategy="DEFAULT",  # prefers nodes that had work before, which have the scene and a warm worker
        num_returns="streaming",
        max_retries=0,
        _generator_backpressure_num_objects=MOST_AHEAD,
    )
    return given.remote(order, mailbox)


def ask_fitness(node_id: str, wanted: Wanted) -> Any:
    """Return a ref to the Fitness of a node; the task takes none of its cores."""
    where = NodeAffinitySchedulingStrategy(node_id, soft=False)
    return _remote(_fitness_of_node).options(num_cpus=0, max_retries=0, scheduling_strategy=where).remote(wanted)


def mailbox_actor(node_id: str, owner: str) -> Any:
    """Return the mailbox on this node, creating it: it ends with its creator, and is found by its name until then."""
    here = NodeAffinitySchedulingStrategy(node_id, soft=False)
    made = ray.remote(Mailbox).options(
        name=f"{MAILBOX}{owner}",
        num_cpus=0,
        max_restarts=-1,
        max_concurrency=MOST_ASKING,
        scheduling_strategy=here,
    )
    return made.remote()


def owners() -> list[str]:
    """Return the owners of all mailboxes of the cluster."""
    names: list[str] = ray.util.list_named_actors()
    return sorted(name.removeprefix(MAILBOX) for name in names if name.startswith(MAILBOX))


def ask_running(owner: str) -> Any:
    """Return a ref to the running chunks of that owner; ValueError if it is gone."""
    return ray.get_actor(f"{MAILBOX}{owner}").running.remote()


ANSWER_AFTER_S = 20.0  # at the latest
MOST_OVER = 10_000  # ended chunks that are remembered


class Mailbox:
    """Mailbox of one driver. All methods run in one event loop."""

    def __init__(self) -> None:
        self._letters: dict[str, list[Json]] = defaultdict(list)
        self._news: dict[str, asyncio.Event] = defaultdict(asyncio.Event)
        self._over: dict[str, None] = {}  # in the order in which they ended
        self._running: dict[str, Json] = {}

    async def put(self, key: str, command: Json) -> None:
        if key not in self._over:
            self._letters[key].append(command)
            self._news[key].set()

    async def take(self, key: str) -> list[Json] | None:
        """Return new commands, maybe none. None: the chunk is over."""
        if key not in self._over:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._news[key].wait(), ANSWER_AFTER_S)
        if key in self._over:
            return None
        self._news[key].clear()
        return self._letters.pop(key, [])

    async def began(self, key: str, about: Json) -> None:
        """Record that a node has the chunk."""
        if key not in self._over:
            self._running[key] = about

    async def running(self) -> list[Json]:
        return list(self._running.values())

    async def forget(self, key: str) -> None:
        """Record that the chunk is over."""
        self._over[key] = None
        self._running.pop(key, None)
        while len(self._over) > MOST_OVER:
            del self._over[next(iter(self._over))]
        self._letters.pop(key, None)
        if key in self._news:
            self._news.pop(key).set()
