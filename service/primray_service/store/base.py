"""What the service asks of its database. Every method is one transaction; every method may be called from any thread.

A method that changes something may be repeated after the connection broke in the middle: it then finds its own change and
answers as it did, or would have. Times are arguments. `Lost` from a method with a `fence` says that another dispatcher
has taken over: what was to be written is not.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from ..jobs import Event, Frame, Job, JobState, Json, Output, Part, Scene
from ..limits import Quotas
from ..waiting.order import Waiting


class Lost(Exception):
    """The lease is another's now."""


class Conflict(Exception):
    """The row's version is not the one expected, or its state does not allow the change."""


class QuotaExceeded(Exception):
    """args[0] names the quota: "queued_jobs", "running_jobs", "stored_bytes", "cpu_s_per_day"."""


class Unavailable(Exception):
    """The database did not answer, however often it was asked for the better part of a minute (503)."""


class KeyReused(Exception):
    """The idempotency key came with another request."""


@dataclass(frozen=True)
class ApiKey:
    id: str
    tenant: str
    name: str
    prefix: str  # the key's first characters, to recognise it by
    sha256: str  # of the key; the key itself is not kept
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
    active: Sequence[tuple[Job, int]]  # with the frames that run


@dataclass(frozen=True)
class JobFilter:
    states: frozenset[JobState] = frozenset()  # empty: all
    labels: Mapping[str, str] = field(default_factory=dict)
    scene_id: str | None = None


@dataclass(frozen=True)
class Claim:
    """A frame that the dispatcher is to run now, its state running."""

    job: Job
    frame: Frame


@dataclass(frozen=True)
class Leader:
    """Who dispatches; `about`: what they said of themselves."""

    holder: str
    expires_in_s: float
    about: Json


@dataclass(frozen=True)
class WebhookDelivery:
    id: str  # the message's, the same for all tries
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
        """Raises if the database does not answer."""

    def close(self) -> None: ...

    def subscribe(self, on_change: Callable[[str], None]) -> Callable[[], None]:
        """Call `on_change(job_id)`, from whatever thread, after each commit that changed a job through this store object, and
        once it listens through others' too; answers a function that ends it."""

    def listen(self, on_told: Callable[[Json], None]) -> None:
        """Hear from now on, from whatever thread, of the other servers over this PostgreSQL: subscribers of their changes,
        `on_told` of what they `tell`. Soon, but not certainly: who depends on it looks from time to time. SQLite tells
        nobody."""

    def tell(self, words: Json) -> None:
        """Have the other servers that listen hear these few words; does not wait."""

    def exclusive(self, name: str) -> AbstractContextManager[None]:
        """While inside, no other thread of any server over this PostgreSQL is inside under this name (SQLite: of this one)."""

    def clock(self) -> float:
        """The time that all servers over this database agree on, for the lease."""

    def create_job(
        self, job: Job, time_codes: Sequence[float | None], quotas: Quotas, idempotency: tuple[str, str] | None = None
    ) -> tuple[Job, bool]:
        """A job with its frames and its first state event; False with the earlier job if its idempotency key (key, sha256 of
        the request) came before (kept for a day at least). KeyReused, QuotaExceeded; Conflict if there is no such scene of
        this tenant."""

    def job(self, job_id: str, tenant: str | None = None) -> Job | None: ...

    def job_versions(self, job_ids: Collection[str]) -> Mapping[str, int]:
        """Of those that are there."""

    def jobs(self, tenant: str | None, where: JobFilter, limit: int, cursor: str | None, newest_first: bool = True) -> Page:
        """By creation, keyset pages: as fast at the end of 100,000 rows as at the start; those of all tenants where `tenant`
        is None, which cannot be asked for by label. ValueError for a bad cursor."""

    def frames(self, job_id: str, limit: int = 1000, after: int = -1) -> Sequence[Frame]: ...

    def frame(self, job_id: str, number: int) -> Frame | None: ...

    def frame_counts(self, job_id: str) -> Mapping[str, int]:
        """By state."""

    def outputs(self, job_id: str) -> Sequence[Output]: ...

    def update_job(self, job_id: str, now: float, *, version: int | None, changes: Json) -> Job:
        """`changes`: of priority, name, labels, ttl_s; Conflict if `version` is given and not the row's (jobs.version_in gives
        it from an entity tag)."""

    def request_cancel(self, job_id: str, now: float) -> Job:
        """Queued: canceled at once; preparing or running: canceling (canceled if none of its frames runs); canceling,
        canceled: no
        change; else Conflict."""

    def request_pause(self, job_id: str, now: float) -> Job:
        """Paused at once where none of its frames runs, else pausing until those have written a checkpoint or ended; its time
        to live begins again. Pausing, paused: no change; Conflict for a job that has ended or is being canceled."""

    def request_resume(self, job_id: str, now: float) -> Job:
        """A paused job is queued again; of one that is pausing, the frames that stop run again. A job that is not paused does
        not change; Conflict for one that has ended or is being canceled."""

    def retry_frame(self, job_id: str, number: int, attempt: int, now: float, quotas: Quotas) -> Job:
        """Queue a frame that ended in this attempt of its own again, without its checkpoint; its outputs stay until new ones
        replace them. A job that had ended is queued again, in the same attempt. Conflict, QuotaExceeded, KeyError."""

    def continue_job(self, job_id: str, stop: Json, now: float, quotas: Quotas) -> Job:
        """A new attempt of a terminal job with other stop rules: every frame queued again, from its checkpoint. Conflict,
        QuotaExceeded."""

    def delete_job(self, job_id: str) -> bool:
        """The row and all that hangs on it. Conflict while a frame runs."""

    def events(self, job_id: str, after: int, limit: int) -> Sequence[Event]: ...

    def contents(self, tenant: str, digests: Collection[str], now: float) -> Mapping[str, int]:
        """Sizes of those that the tenant has, by digest; they were used now."""

    def has_content(self, tenant: str, sha256: str) -> bool: ...

    def put_content(self, tenant: str, sha256: str, size: int, now: float, quotas: Quotas) -> bool:
        """Note that a tenant has a file of this digest; whether it is new. QuotaExceeded."""

    def contents_of_scene(self, tenant: str, scene_id: str) -> Sequence[str]:
        """Digests of the files that a scene was put together from; none of one that was uploaded whole."""

    def unused_contents(self, fence: int, before: float, limit: int) -> Sequence[tuple[str, str]]:
        """(tenant, digest) of what no scene has and nobody asked for since."""

    def forget_content(self, tenant: str, sha256: str, before: float) -> bool:
        """Remove a row if it is still unused; whether it was."""

    def put_scene(self, scene: Scene, quotas: Quotas, contents: Collection[str] = ()) -> tuple[Scene, bool]:
        """The tenant's scene of these bytes, made if there was none (True). If another tenant's same scene was checked
        already, the
        new row takes its findings. `contents`: digests of the files that it is put together from; Conflict where the tenant
        lacks one. QuotaExceeded."""

    def scene(self, tenant: str, scene_id: str) -> Scene | None: ...

    def scenes(self, tenant: str, limit: int, cursor: str | None) -> tuple[Sequence[Scene], str | None]: ...

    def delete_scene(self, tenant: str, scene_id: str) -> bool:
        """Whether the bytes are nobody's now. Conflict while jobs that are not terminal use it; KeyError if there is none."""

    def has_scene(self, scene_id: str) -> bool:
        """Whether any tenant has a scene of these bytes."""

    def next_check(self, fence: int) -> Scene | None:
        """A scene that waits for its check, oldest first."""

    def scene_checked(
        self, fence: int, scene_id: str, now: float, *, facts: Json, warnings: list[Json], problem: Json | None
    ) -> None:
        """Ready, or rejected with a problem; all tenants' rows. Queued jobs of a rejected scene fail with the problem."""

    def acquire_lease(self, holder: str, now: float, ttl_s: float, about: Json | None = None) -> int | None:
        """A fence, larger than all before, if nobody holds the lease or its holder's time is over. Jobs whose frames were
        running go back to queued (canceling ones with no frame left to run: canceled). `about`: what the holder can do, for
        the others."""

    def renew_lease(self, fence: int, now: float, ttl_s: float, about: Json | None = None) -> None:
        """Lost if another has it. `about`: as it is now; None: as before."""

    def release_lease(self, fence: int) -> None: ...

    def lease_expires_at(self) -> float | None: ...

    def leader(self) -> Leader | None:
        """Who holds the lease; None if nobody does or their time is over."""

    def claim_frame(self, fence: int, now: float, quotas_of: Callable[[str], Quotas]) -> Claim | None:
        """The next frame to run: of jobs by (priority, fewest frames running of that tenant, created), frames in order; only
        jobs whose scene
        is ready, whose tenant is within running_jobs and cpu_s_per_day. The frame becomes running, a queued job preparing."""

    def claim_frames(
        self,
        fence: int,
        now: float,
        quotas_of: Callable[[str], Quotas],
        most: int,
        served: Mapping[str, int] | None = None,
        running: Mapping[str, int] | None = None,
    ) -> Sequence[Claim]:
        """So many at most, as `claim_frame` would give them one after another; fewer where a job asks to be rendered in parts,
        which is the last. `served`: numbers of tenants' last turns: among those of equal rights, the smallest goes first.
        `running`: frames of each tenant that have a slot: by the rows, those run too that have none any more."""

    def waiting(
        self, fence: int, now: float | None = None, quotas_of: Callable[[str], Quotas] | None = None
    ) -> Sequence[tuple[int, str]]:
        """(priority, tenant) of the best waiting job of each tenant that could run, for deciding who gives way; with `now`
        and `quotas_of`: of those that claim_frame would give."""

    def queue(self, most: int) -> QueueNow:
        """Jobs with frames that could be claimed, of high priority and old ones first, so many at most; and those that run."""

    def running_frames(self, limit: int) -> Sequence[tuple[Job, Frame]]:
        """Frames that run, of all tenants, with their jobs, by when they began."""

    def note_work(self, fence: int, work: str, seconds: float, now: float, most: int) -> None:
        """How long a frame of a work takes; of more works than `most` the one noted first is forgotten."""

    def work_seconds(self) -> Mapping[str, float]:
        """By work, those noted first first."""

    def report(
        self, fence: int, frame: Frame, now: float, *, job_changes: Json | None = None, event: tuple[str, Json] | None = None
    ) -> Job:
        """Store a running frame's phase, progress, effective settings, convergence, cpu_s and peak_rss_bytes, and with it
        what it changes of its job
        (progress, effective_settings, warnings, state running) and one event."""

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
        """Take over the checkpoint `follows + 1` of a frame, once: False if the frame is at another one, or not running, or
        in another attempt.
        Its deaths are forgotten. Repeating the call with the same chunk_id answers True again. `merged`: it holds exactly the
        first so many samples, put together of parts, whose rows go; 0: no such checkpoint, and no part is of use any more."""

    def parts(self, job_id: str, frame: int) -> Sequence[Part]:
        """Of a frame, those whose samples are not in its checkpoint, by their first sample."""

    def give_out_part(self, fence: int, frame: Frame, part: Part) -> bool:
        """A part, new or not, is `part.claim`'s now, whoever had it; False if the frame does not run."""

    def accept_part(self, fence: int, frame: Frame, part: Part) -> bool:
        """Store what `part.claim` made of it: its state, checkpoint and deaths. False if it is another's, or the frame does
        not run."""

    def drop_parts(self, fence: int, frame: Frame) -> None:
        """Those of a running frame, with what was merged of it: it begins anew."""

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
        """A running frame reached `frame.state` (terminal). Its outputs take the place of its earlier ones. If it was the
        last, the job ends
        (jobs.state_of_all; canceling: canceled) with `job_changes` (result, error, warnings, usage, progress,
        effective_settings), an end
        event, and its webhooks; CPU seconds are counted to the tenant's day."""

    def requeue_frame(self, fence: int, frame: Frame, now: float) -> Job:
        """A running frame goes back to queued (it gave way, or its worker died: `crashes` and `kills` say how often); its
        job to queued if no
        other frame of it runs. Of a job that is canceling, it becomes canceled."""

    def expire(self, fence: int, now: float, limit: int) -> tuple[Sequence[Job], Sequence[str]]:
        """Jobs that were not finished in time and are expired now (running ones too: their workers are to be killed), and
        ids of
        terminal jobs past their time, to be deleted."""

    def unused_scenes(self, fence: int, before: float, limit: int) -> Sequence[Scene]:
        """Scenes that no job uses and nobody touched since."""

    def create_key(self, key: ApiKey) -> None: ...

    def key_by_sha256(self, sha256: str) -> ApiKey | None: ...

    def keys(self, tenant: str | None = None) -> Sequence[ApiKey]: ...

    def revoke_key(self, key_id: str, now: float) -> bool: ...

    def end_session(self, session: str, until: float, now: float) -> None:
        """It is logged out of, for as long as it could have gone on; who did so before `now` is forgotten."""

    def session_has_ended(self, session: str) -> bool: ...

    def usage(self, tenant: str, now: float) -> Usage: ...

    def usage_of_all(self, now: float, limit: int, after: str = "") -> Sequence[tuple[str, Usage]]:
        """Usage of each tenant that has a key, set quotas, or has used anything, by name."""

    def quotas_set(self, tenant: str) -> Json:
        """Members of Quotas that an administrator set for a tenant."""

    def set_quotas(self, tenant: str, quotas: Json, now: float) -> None:
        """Set them in place of those set before; none: the tenant has its keys' quotas again."""

    def counts(self) -> Mapping[str, int]:
        """Jobs by state, over all tenants, for metrics: cheap at 100,000 jobs."""

    def due_webhooks(self, fence: int, now: float, limit: int) -> Sequence[WebhookDelivery]: ...

    def webhook_tried(self, fence: int, delivery_id: str, *, state: str, next_at: float, error: str) -> None: ...

    def webhooks(self, job_id: str) -> Sequence[WebhookDelivery]: ...
