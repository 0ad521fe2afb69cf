"""Interface of the database. Every method is one transaction, and every method is thread-safe.

A method that changes something may be repeated after the connection broke in the middle: it then finds its own change and
answers as it did, or would have. Times are arguments. `Lost` from a method with a `fence` says that another dispatcher has
taken over: nothing was written.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from ..jobs import Event, Frame, Job, JobState, Json, Output, Part, Scene
from ..limits import Quotas
from ..queue.order import Waiting


class Lost(Exception):
    """Another server holds the lease now."""


class Conflict(Exception):
    """The row's version is not the expected one, or its state does not allow the change."""


class QuotaExceeded(Exception):
    """A quota is exceeded; args[0] names it: "queued_jobs", "running_jobs", "stored_bytes", "cpu_s_per_day"."""


class Unavailable(Exception):
    """The database did not answer in the better part of a minute of retries (503)."""


class KeyReused(Exception):
    """The idempotency key came with another request before."""


@dataclass(frozen=True, kw_only=True)
class ApiKey:
    id: str
    tenant: str
    name: str
    prefix: str  # first characters of the key, to recognise it by
    sha256: str  # of the key; the key itself is not stored
    scopes: frozenset[str]  # submit, read, admin
    quotas: Quotas
    created_at: float
    expires_at: float | None = None
    revoked_at: float | None = None


@dataclass(frozen=True)
class Page:
    items: Sequence[Job]
    next_cursor: str | None  # opaque


@dataclass(frozen=True)
class QueueNow:
    waiting: Sequence[Waiting]
    active: Sequence[tuple[Job, int]]  # with their running frames


@dataclass(frozen=True)
class JobFilter:
    states: frozenset[JobState] = frozenset()  # empty: all
    labels: Mapping[str, str] = field(default_factory=dict)
    scene_id: str | None = None


@dataclass(frozen=True)
class Claim:
    """A frame that the dispatcher is to run now; its state is running."""

    job: Job
    frame: Frame


@dataclass(frozen=True)
class Leader:
    """The server that dispatches; `about`: what it publishes about itself."""

    holder: str
    expires_in_s: float
    about: Json


@dataclass(frozen=True)
class WebhookDelivery:
    id: str  # the message's id, the same for all attempts
    job_id: str
    url: str
    secret: str
    event: str
    payload: Json
    tries: int
    next_at: float
    state: str = "due"  # due, delivered, failed (given up)
    last_error: str = ""


@dataclass(frozen=True)
class Usage:
    queued_jobs: int
    running_jobs: int
    stored_bytes: int
    cpu_s_today: float
    cpu_s_total: float


class Store(Protocol):
    def migrate(self) -> None:
        """Bring the schema up to date (Alembic); several servers may do so at once."""

    def check(self) -> None:
        """Raise if the database does not answer."""

    def close(self) -> None: ...

    def subscribe(self, on_change: Callable[[str], None]) -> Callable[[], None]:
        """Call `on_change(job_id)`, from any thread, after each commit that changes a job through this store object, and once
        it listens, through others, too; return a function that ends it."""

    def listen(self, on_notice: Callable[[Json], None]) -> None:
        """Receive notices of the other servers on this PostgreSQL from now on, in any thread: changes for subscribers, and for
        `on_told` what they `tell`. Delivery is quick but not guaranteed, so dependents poll as well. SQLite sends no
        notices."""

    def tell(self, words: Json) -> None:
        """Send a short notice to the other servers that listen; does not block."""

    def exclusive(self, name: str) -> AbstractContextManager[None]:
        """Provide mutual exclusion under this name among all threads of all servers on this PostgreSQL (SQLite: of this
        server)."""

    def clock(self) -> float:
        """Return the time that all servers on this database agree on, for the lease."""

    def create_job(
        self, job: Job, time_codes: Sequence[float | None], quotas: Quotas, idempotency: tuple[str, str] | None = None
    ) -> tuple[Job, bool]:
        """Create a job with its frames and its first state event; return False with the earlier job if its idempotency key
        (key, sha256 of the request) came before (kept for a day at least). KeyReused, QuotaExceeded; Conflict if the tenant has
        no such scene."""

    def job(self, job_id: str, tenant: str | None = None) -> Job | None: ...

    def job_versions(self, job_ids: Collection[str]) -> Mapping[str, int]:
        """Return the versions of those jobs that exist."""

    def jobs(self, tenant: str | None, where: JobFilter, limit: int, cursor: str | None, newest_first: bool = True) -> Page:
        """Return a page of jobs by creation (keyset pagination: as fast at the end of 100,000 rows as at the start); of all
        tenants if `tenant` is None, which excludes labels. ValueError for a bad cursor."""

    def frames(self, job_id: str, limit: int = 1000, after: int = -1) -> Sequence[Frame]: ...

    def frame(self, job_id: str, number: int) -> Frame | None: ...

    def frame_counts(self, job_id: str) -> Mapping[str, int]:
        """Return the number of frames by state."""

    def outputs(self, job_id: str) -> Sequence[Output]: ...

    def update_job(self, job_id: str, now: float, *, version: int | None, changes: Json) -> Job:
        """Update priority, name, labels or ttl_s by `changes`; Conflict if `version` is given and not the row's
        (jobs.version_in reads it from an entity tag)."""

    def request_cancel(self, job_id: str, now: float) -> Job:
        """Request cancellation. Queued: canceled at once; preparing or running: canceling (canceled if none of its frames
        runs); canceling, canceled: no change; else Conflict."""

    def request_pause(self, job_id: str, now: float) -> Job:
        """Request a pause. The job is paused at once if none of its frames runs, else pausing until those have written a
        checkpoint or ended; its time to live restarts. Pausing, paused: no change; Conflict for a job that has ended or is
        being canceled."""

    def request_resume(self, job_id: str, now: float) -> Job:
        """Resume a job. A paused job is queued again; if it is pausing, frames that stop will run again. A job that is not
        paused does not change; Conflict for one that has ended or is being canceled."""

    def retry_frame(self, job_id: str, number: int, attempt: int, now: float, quotas: Quotas) -> Job:
        """Queue a frame again that ended in this attempt of its own, without its checkpoint; its outputs stay until new ones
        replace them. A job that had ended is queued again, in the same attempt. Conflict, QuotaExceeded, KeyError."""

    def continue_job(self, job_id: str, stop: Json, now: float, quotas: Quotas) -> Job:
        """Start a new attempt of a terminal job with other stop rules: every frame is queued again, from its checkpoint.
        Conflict, QuotaExceeded."""

    def delete_job(self, job_id: str) -> bool:
        """Delete a job's row and all that depends on it. Conflict while a frame runs."""

    def events(self, job_id: str, after: int, limit: int) -> Sequence[Event]: ...

    def contents(self, tenant: str, digests: Collection[str], now: float) -> Mapping[str, int]:
        """Return the sizes of those contents that the tenant has, by digest, and mark them as used."""

    def has_content(self, tenant: str, sha256: str) -> bool: ...

    def put_content(self, tenant: str, sha256: str, size: int, now: float, quotas: Quotas) -> bool:
        """Record that a tenant has a file with this digest; return whether it is new. QuotaExceeded."""

    def contents_of_scene(self, tenant: str, scene_id: str) -> Sequence[str]:
        """Return the digests of the files that a scene was assembled from; none for a scene that was uploaded whole."""

    def unused_contents(self, fence: int, before: float, limit: int) -> Sequence[tuple[str, str]]:
        """Return (tenant, digest) of contents that belong to no scene and were not used since `before`."""

    def forget_content(self, tenant: str, sha256: str, before: float) -> bool:
        """Remove a row if it is still unused; return whether it was."""

    def put_scene(self, scene: Scene, quotas: Quotas, contents: Collection[str] = ()) -> tuple[Scene, bool]:
        """Return the tenant's scene of these bytes, created if there was none (True). If another tenant's equal scene was
        checked already, the new row takes its results. `contents`: digests of the files that it is assembled from; Conflict if
        the tenant lacks one. QuotaExceeded."""

    def scene(self, tenant: str, scene_id: str) -> Scene | None: ...

    def scenes(self, tenant: str, limit: int, cursor: str | None) -> tuple[Sequence[Scene], str | None]: ...

    def delete_scene(self, tenant: str, scene_id: str) -> bool:
        """Delete a tenant's scene; return whether no tenant has its bytes now. Conflict while jobs that are not terminal use
        it; KeyError if there is none."""

    def has_scene(self, scene_id: str) -> bool:
        """Return whether any tenant has a scene of these bytes."""

    def next_check(self, fence: int) -> Scene | None:
        """Return the oldest scene that waits for its check."""

    def scene_checked(
        self, fence: int, scene_id: str, now: float, *, facts: Json, warnings: list[Json], problem: Json | None
    ) -> None:
        """Mark a scene as ready, or rejected with a problem, in all tenants' rows. Queued jobs of a rejected scene fail with
        the problem."""

    def acquire_lease(self, holder: str, now: float, ttl_s: float, about: Json | None = None) -> int | None:
        """Acquire the lease: return a fence, larger than all before, if nobody holds the lease or it has expired. Jobs whose
        frames were running are queued again (canceling ones with no frame left to run: canceled). `about`: the holder's
        capabilities, for other servers."""

    def renew_lease(self, fence: int, now: float, ttl_s: float, about: Json | None = None) -> None:
        """Renew the lease; Lost if another has it. `about`: the current capabilities; None: unchanged."""

    def release_lease(self, fence: int) -> None: ...

    def lease_expires_at(self) -> float | None: ...

    def leader(self) -> Leader | None:
        """Return the holder of the lease; None if there is none or it has expired."""

    def claim_frame(self, fence: int, now: float, quotas_of: Callable[[str], Quotas]) -> Claim | None:
        """Claim the next frame to run: of jobs by (priority, fewest running frames of the tenant, created), frames in order;
        only jobs whose scene is ready, whose tenant is within running_jobs and cpu_s_per_day. The frame becomes running, a
        queued job preparing."""

    def claim_frames(
        self,
        fence: int,
        now: float,
        quotas_of: Callable[[str], Quotas],
        most: int,
        served: Mapping[str, int] | None = None,
        running: Mapping[str, int] | None = None,
    ) -> Sequence[Claim]:
        """Claim at most `most` frames, as `claim_frame` would one after another; fewer if a job asks to be rendered as parts,
        which is the last. `served`: numbers of tenants' last turns: among equals, the smallest goes first. `running`: frames of
        each tenant that have a slot: rows also count running frames that have none any more."""

    def waiting(
        self, fence: int, now: float | None = None, quotas_of: Callable[[str], Quotas] | None = None
    ) -> Sequence[tuple[int, str]]:
        """Return (priority, tenant) of the best waiting job of each tenant that could run, for preemption; with `now` and
        `quotas_of`: only those that claim_frame would return."""

    def queue(self, most: int) -> QueueNow:
        """Return up to `most` jobs with claimable frames, high priority and old ones first; and those that run."""

    def running_frames(self, limit: int) -> Sequence[tuple[Job, Frame]]:
        """Return running frames of all tenants, with their jobs, by start time."""

    def note_work(self, fence: int, work: str, seconds: float, now: float, most: int) -> None:
        """Record how long a frame of a work takes; of more works than `most` the one recorded first is forgotten."""

    def work_seconds(self) -> Mapping[str, float]:
        """Return the seconds by work, in order of recording."""

    def report(
        self,
        fence: int,
        frame: Frame,
        now: float,
        *,
        job_changes: Json | None = None,
        events: Sequence[tuple[str, Json]] = (),
    ) -> Job:
        """Store a running frame's phase, progress, effective settings, convergence, cpu_s and peak_rss_bytes, with its changes
        to the job (progress, effective_settings, warnings, state running) and events."""

    def accept_checkpoint(
        self,
        fence: int,
        chunk_id: str,
        job_id: str,
        number: int,
        *,
        attempt: int,
        follows: int,
        file: str,
        now: float,
        merged: int = 0,
    ) -> bool:
        """Accept the checkpoint `follows + 1` of a frame, once: False if the frame is at another one, or not running, or in
        another attempt. Its deaths are reset. Repeating the call with the same chunk_id returns True again. `merged`: it holds
        exactly that many first samples, merged from parts, whose rows are deleted; 0: it is no such checkpoint, and all parts
        are obsolete."""

    def parts(self, job_id: str, frame: int) -> Sequence[Part]:
        """Return the parts of a frame whose samples are not in its checkpoint, by their first sample."""

    def give_out_part(self, fence: int, frame: Frame, part: Part) -> bool:
        """Hand out a part, new or not, to `part.claim`, whoever had it; False if the frame does not run."""

    def accept_part(self, fence: int, frame: Frame, part: Part) -> bool:
        """Store the result of `part.claim`: the part's state, checkpoint and deaths. False if another chunk has it, or the
        frame does not run."""

    def drop_parts(self, fence: int, frame: Frame) -> None:
        """Drop the parts of a running frame, and its merged samples: it starts again."""

    def end_frame(
        self,
        fence: int,
        frame: Frame,
        now: float,
        *,
        outputs: Sequence[Output],
        job_changes: Json,
        webhook_events: Sequence[str] = (),
    ) -> Job:
        """End a running frame in `frame.state` (terminal). Its outputs replace its earlier ones. If it was the last, the job
        ends (jobs.state_of_all; canceling: canceled) with `job_changes` (result, error, warnings, usage, progress,
        effective_settings), an end event, and its webhooks; CPU seconds count towards the tenant's day."""

    def requeue_frame(self, fence: int, frame: Frame, now: float) -> Job:
        """Queue a running frame again (it was preempted, or its worker died: `crashes` and `kills` count that); its job is
        queued if no other frame of it runs. A frame of a canceling job becomes canceled."""

    def expire(self, fence: int, now: float, limit: int) -> tuple[Sequence[Job], Sequence[str]]:
        """Return jobs that were not finished in time and are expired now (including running ones, whose workers are to be
        killed), and ids of terminal jobs past their time, to be deleted."""

    def unused_scenes(self, fence: int, before: float, limit: int) -> Sequence[Scene]:
        """Return scenes that no job uses and nobody used since `before`."""

    def create_key(self, key: ApiKey) -> None: ...

    def key_by_sha256(self, sha256: str) -> ApiKey | None: ...

    def keys(self, tenant: str | None = None) -> Sequence[ApiKey]: ...

    def revoke_key(self, key_id: str, now: float) -> bool: ...

    def end_session(self, session: str, until: float, now: float) -> None:
        """End a session until its natural end; logouts that expired before `now` are forgotten."""

    def session_has_ended(self, session: str) -> bool: ...

    def usage(self, tenant: str, now: float) -> Usage: ...

    def spend_cpu(self, tenant: str, now: float, cpu_s: float) -> None:
        """Count CPU seconds that a tenant has used outside of frames: an explained pixel's."""

    def usage_of_all(self, now: float, limit: int, after: str = "") -> Sequence[tuple[str, Usage]]:
        """Return the usage of each tenant that has a key, set quotas, or has used anything, by name."""

    def quotas_set(self, tenant: str) -> Json:
        """Return the quotas that an administrator set for a tenant."""

    def set_quotas(self, tenant: str, quotas: Json, now: float) -> None:
        """Set a tenant's quotas in place of earlier ones; none: those of its keys apply again."""

    def counts(self) -> Mapping[str, int]:
        """Return the number of jobs by state, over all tenants, for metrics: cheap at 100,000 jobs."""

    def due_webhooks(self, fence: int, now: float, limit: int) -> Sequence[WebhookDelivery]: ...

    def webhook_tried(self, fence: int, delivery_id: str, *, state: str, next_at: float, error: str) -> None: ...

    def webhooks(self, job_id: str) -> Sequence[WebhookDelivery]: ...
