"""Everything that Ray is asked to run on nodes. Functions of modules are sent by name, so a node must have the same primray."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import ray
import ray.util
from ray.exceptions import RayError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from ....jobs import Json
from . import chunk_task
from .fitness import Fitness, fitness
from .mailbox import Mailbox
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


def _told_fitness(wanted: Wanted) -> Fitness:
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
    return _remote(_told_fitness).options(num_cpus=0, max_retries=0, scheduling_strategy=where).remote(wanted)


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
