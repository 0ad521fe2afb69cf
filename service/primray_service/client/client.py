"""The client: one method for each operation of the service."""

from __future__ import annotations

import base64
import hashlib
import os
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, TypeVar
from urllib.parse import quote

from .admin import Administration
from .documents import Convergence, Event, Frame, Job, Json, Key, Output, Scene, Settings, StopRules, Usage, Webhook, read
from .errors import ProblemError, ServerUnreachable, TimedOut, UnexpectedAnswer
from .transfers import Show, download, target_of, upload_files
from .transport import Reading, Transport, items_of, job_path, json_of, object_of

DEFAULT_SERVER = "http://127.0.0.1:8700"
LONG_POLL_S = 30.0
PAGE_ITEMS = 200
QUIET_S = 90.0  # a stream that is silent for this long is considered dead

T = TypeVar("T")


def nothing(done: int, of: int) -> None:
    """Show no progress."""


class Client:
    """Client of a service. `server` and `key` default to $PRIMRAY_SERVER and $PRIMRAY_API_KEY.

    Not for use by several threads at once. `retries` counts tries after the first one, `first_retries` those before the server
    has answered at all (None: the same number); see transport.py for what is retried. `on_wait` is called with a problem and
    the seconds until the request is sent again.
    """

    def __init__(
        self,
        server: str | None = None,
        key: str | None = None,
        *,
        retries: int = 6,
        first_retries: int | None = None,
        timeout_s: float = 30.0,
        sleep: Callable[[float], None] = time.sleep,
        on_wait: Callable[[ProblemError, float], None] | None = None,
    ) -> None:
        server = server or os.environ.get("PRIMRAY_SERVER") or DEFAULT_SERVER
        key = key or os.environ.get("PRIMRAY_API_KEY")
        self._sleep = sleep
        self.has_key = bool(key)
        tries: dict[str, Any] = {"retries": retries, "first_retries": first_retries, "timeout_s": timeout_s}
        self._transport = Transport(server, key, **tries, sleep=sleep, on_wait=on_wait)

    @property
    def server(self) -> str:
        return self._transport.server

    @property
    def admin(self) -> Administration:
        """Return the administrator's operations, which need a key with the scope admin."""
        return Administration(self._transport)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        self._transport.close()

    def upload(self, path: str | os.PathLike[str], *, name: str | None = None, show: Show = nothing) -> Scene:
        """Upload a usda, usdc, usdz or zip; only its digest is sent if the server has it already."""
        file = Path(path)
        with file.open("rb") as opened:
            digest = hashlib.file_digest(opened, "sha256")
        known = self.find_scene(f"sha256:{digest.hexdigest()}")
        if known is not None:
            return known
        size = file.stat().st_size

        def parts() -> Iterator[bytes]:
            done = 0
            with file.open("rb") as opened:
                while part := opened.read(2**20):
                    done += len(part)
                    yield part
                    show(done, size)

        headers = {
            "Content-Type": "application/octet-stream",
            "Content-Length": str(size),
            "Repr-Digest": f"sha-256=:{base64.b64encode(digest.digest()).decode()}:",
        }
        answer = self._transport.request(
            "POST",
            "/v1/scenes",
            params={"name": name or file.name},
            headers=headers,
            content=parts,
            repeatable=True,
            timeout_s=300.0,
        )
        return read(Scene, json_of(answer))

    def upload_files(self, files: Mapping[str, str | os.PathLike[str]], *, name: str = "", show: Show = nothing) -> Scene:
        """Upload a package by content: `files` by their paths in it. Only files that this tenant has not uploaded yet are sent;
        an interrupted upload is resumed by calling this again.

        Raises ProblemError with status 404 or 405 from a server that does not support it.
        """
        return upload_files(self._transport, {path: Path(file) for path, file in files.items()}, name, show)

    def find_scene(self, scene_id: str) -> Scene | None:
        """Return the scene, or None if the server does not have it."""
        path = f"/v1/scenes/{quote(scene_id, safe=':')}"
        # A refused HEAD has no body, so GET is sent to obtain the refusal's text.
        if self._transport.request("HEAD", path, accept=frozenset({401, 403, 404})).status_code == 404:
            return None
        return self.scene(scene_id)

    def scene(self, scene_id: str) -> Scene:
        return read(Scene, self._get(f"/v1/scenes/{quote(scene_id, safe=':')}"))

    def wait_for_scene(self, scene_id: str, timeout_s: float | None = None) -> Scene:
        """Wait until the scene is checked: its state is then ready or rejected."""
        deadline = _deadline(timeout_s)
        delay = 0.05
        while (scene := self.scene(scene_id)).state == "checking":
            _check(deadline, f"{scene_id} was not checked in time")
            self._sleep(delay)
            delay = min(1.0, delay * 1.5)
        return scene

    def scenes(self) -> Iterator[Scene]:
        return self._pages("/v1/scenes", {}, Scene)

    def delete_scene(self, scene_id: str) -> None:
        self._transport.request("DELETE", f"/v1/scenes/{quote(scene_id, safe=':')}")

    def submit(
        self,
        scene: Scene | str,
        *,
        entry: str | None = None,
        settings: Settings | None = None,
        name: str | None = None,
        parallel: int | Literal["auto"] | None = None,
        priority: int | None = None,
        labels: Mapping[str, str] | None = None,
        ttl_s: float | None = None,
        webhook: Webhook | None = None,
        idempotency_key: str | None = None,
    ) -> Job:
        """Create a job of a scene, given as such, by its id, or as a stage on the service's shared storage
        (shared:NAME/path.usda).

        However often the request is repeated, it creates one job. Give `idempotency_key` if that is to hold across restarts of
        the caller.
        """
        named = scene if isinstance(scene, str) else scene.id
        where = {"shared": named.removeprefix("shared:")} if named.startswith("shared:") else {"id": named}
        body: Json = {"scene": where}
        if entry is not None:
            body["scene"]["entry"] = entry
        optional: Json = {"settings": settings, "name": name, "parallel": parallel, "priority": priority}
        optional |= {"ttl_s": ttl_s, "webhook": webhook}
        body |= {name: value for name, value in optional.items() if value is not None}
        if labels:
            body["labels"] = dict(labels)
        headers = {"Idempotency-Key": idempotency_key or str(uuid.uuid4())}
        return read(Job, json_of(self._transport.request("POST", "/v1/jobs", body=body, headers=headers, repeatable=True)))

    def job(self, job_id: str) -> Job:
        return read(Job, self._get(job_path(job_id)))

    def document(self, job_id: str) -> Json:
        """Return a job as the server describes it, complete."""
        return object_of(self._get(job_path(job_id)))

    def documents(self, *, state: str | None = None, labels: Mapping[str, str] | None = None) -> Iterator[Json]:
        """Yield the jobs as the server describes them, newest first."""
        params: dict[str, Any] = {"state": state, "label": [f"{name}:{value}" for name, value in (labels or {}).items()]}
        return (object_of(item) for item in self._items("/v1/jobs", {name: value for name, value in params.items() if value}))

    def jobs(self, *, state: str | None = None, labels: Mapping[str, str] | None = None) -> Iterator[Job]:
        """Yield the jobs, newest first; pages are requested as needed."""
        return (read(Job, document) for document in self.documents(state=state, labels=labels))

    def wait(self, job_id: str, timeout_s: float | None = None, on_change: Callable[[Job], None] | None = None) -> Job:
        """Wait until the job has ended, however it ended; TimedOut if that takes longer than `timeout_s`."""
        deadline = _deadline(timeout_s)
        etag: str | None = None
        while True:
            left = LONG_POLL_S if deadline is None else max(0.0, min(LONG_POLL_S, deadline - time.monotonic()))
            headers = {"Prefer": f"wait={int(left)}"} | ({"If-None-Match": etag} if etag else {})
            begun = time.monotonic()
            answer = self._transport.request(
                "GET", job_path(job_id), headers=headers, timeout_s=LONG_POLL_S + 30, accept=frozenset({304})
            )
            if answer.status_code != 304:
                etag = answer.headers.get("ETag")
                job = read(Job, json_of(answer))
                if job.is_terminal:
                    return job
                if on_change is not None:
                    on_change(job)
            _check(deadline, f"{job_id} did not end in time")
            if time.monotonic() - begun < 0.25:  # the server does not long-poll, or the job changes all the time
                self._sleep(0.25)

    def last_event_id(self, job_id: str) -> int | None:
        """Return the id of the newest event, after which `watch` yields only new ones; None if there is no event."""
        last: int | None = None
        while True:
            params = {} if last is None else {"after": last}
            answer = self._transport.request(
                "GET", f"{job_path(job_id)}/events", params=params, headers={"Accept": "application/json"}
            )
            page = object_of(json_of(answer))
            if not page.get("items"):
                return last
            last = int(page["next_after"])

    def watch(self, job_id: str, after: int | None = None) -> Iterator[Event]:
        """Yield a job's events, from its beginning or after one of them, until it has ended; broken connections are
        re-established."""
        reading = Reading(last_id=after)
        tries = 0
        while True:
            before = reading.last_id
            try:
                headers = {"Accept": "text/event-stream", "Accept-Encoding": "identity"}
                if reading.last_id is not None:
                    headers["Last-Event-ID"] = str(reading.last_id)
                with self._transport.stream(f"{job_path(job_id)}/events", headers, timeout_s=QUIET_S) as answer:
                    if answer.status_code == 204:  # there are no further events, and never will be
                        return
                    if not answer.headers.get("Content-Type", "").startswith("text/event-stream"):
                        raise UnexpectedAnswer(f"the events of {job_id} are not an event stream")
                    for event in reading.events(answer.iter_raw()):
                        yield event
                        if event.type == "end" and self._is_last(job_id, event):
                            return
            except (ServerUnreachable, ProblemError) as error:
                tries = 0 if reading.last_id != before else tries + 1
                self._transport.patiently(max(0, tries - 1), error)
                continue
            # The server closed the stream: it is stopping, or there are no further events.
            if self.job(job_id).is_terminal and reading.last_id == before:
                return
            self._sleep(reading.retry_s)

    def _is_last(self, job_id: str, end: Event) -> bool:
        """Return whether no event follows this end: a continued job has an end for each attempt."""
        job = self.job(job_id)
        if not job.is_terminal or end.data.get("attempt", job.attempt) != job.attempt:
            return False
        ended = end.data.get("finished_at")  # a job whose frame is retried ends again in the same attempt
        return ended is None or job.finished_at is None or datetime.fromisoformat(ended) == job.finished_at

    def change(
        self, job_id: str, *, priority: int | None = None, labels: Mapping[str, str] | None = None, ttl_s: float | None = None
    ) -> Job:
        changes = {"priority": priority, "labels": None if labels is None else dict(labels), "ttl_s": ttl_s}
        body = {name: value for name, value in changes.items() if value is not None}
        return read(Job, json_of(self._transport.request("PATCH", job_path(job_id), body=body, repeatable=True)))

    def cancel(self, job_id: str) -> Job:
        """Cancel a job. It ends soon and keeps the picture rendered so far."""
        return read(Job, json_of(self._transport.request("POST", f"{job_path(job_id)}/cancel", repeatable=True)))

    def pause(self, job_id: str) -> Job:
        """Pause a job. Its running frames write checkpoints and free their workers; no frame starts until it is resumed."""
        return read(Job, json_of(self._transport.request("POST", f"{job_path(job_id)}/pause", repeatable=True)))

    def resume(self, job_id: str) -> Job:
        return read(Job, json_of(self._transport.request("POST", f"{job_path(job_id)}/resume", repeatable=True)))

    def retry_frame(self, job_id: str, number: int) -> Job:
        """Render one finished frame again; the others stay. Not retried if the answer is lost: the frame's state then shows
        whether it is queued."""
        return read(Job, json_of(self._transport.request("POST", f"{job_path(job_id)}/frames/{number}/retry")))

    def continue_(self, job_id: str, stop: StopRules) -> Job:
        """Start a new attempt from the last one's checkpoints, with other stop rules. Not retried if the answer is lost: the
        job's state then shows whether it continues."""
        return read(Job, json_of(self._transport.request("POST", f"{job_path(job_id)}/continue", body={"stop": stop})))

    def delete(self, job_id: str) -> None:
        """Delete a job and all of its files; it is canceled first if it runs."""
        self._transport.request("DELETE", job_path(job_id))

    def frames(self, job_id: str) -> Iterator[Frame]:
        return self._pages(f"{job_path(job_id)}/frames", {}, Frame)

    def frame(self, job_id: str, number: int) -> Frame:
        return read(Frame, self._get(f"{job_path(job_id)}/frames/{number}"))

    def explain(self, job_id: str, x: int, y: int, *, frame: int = 0, timeout_s: float = 600.0) -> Json:
        """Return whose light a pixel of an ended frame is made of, as `primray explain --json` prints it; `x` and `y` from the
        picture's upper left corner. The service renders the pixel again, which takes it a moment."""
        path = f"{job_path(job_id)}/frames/{frame}/explain"
        body = {"x": x, "y": y}
        return object_of(json_of(self._transport.request("POST", path, body=body, repeatable=True, timeout_s=timeout_s)))

    def convergence(self, job_id: str, frame: int = 0) -> list[Convergence]:
        rows = self._get(f"{job_path(job_id)}/convergence", {"frame": frame})
        return [read(Convergence, row) for row in items_of(rows)]

    def preview(self, job_id: str, *, frame: int = 0, exposure: float = 0.0, view: str = "beauty") -> bytes:
        """Return a PNG of the picture's current state."""
        params = {"frame": frame, "exposure": exposure, "view": view}
        headers = {"Accept": "image/png"}
        return self._transport.request("GET", f"{job_path(job_id)}/preview", params=params, headers=headers).content

    def log(self, job_id: str) -> str:
        return self._transport.request("GET", f"{job_path(job_id)}/log", headers={"Accept": "text/plain"}).text

    def outputs(self, job_id: str) -> list[Output]:
        return list(self._pages(f"{job_path(job_id)}/outputs", {}, Output))

    def download(
        self,
        job_id: str,
        output: Output,
        folder: str | os.PathLike[str] = ".",
        *,
        show: Show = nothing,
        overwrite: bool = False,
    ) -> Path:
        """Download an output into a folder, under its name; an interrupted download is resumed.

        Raises FileExistsError if a file with other contents has the name, unless `overwrite`.
        """
        return download(self._transport, job_id, output, target_of(output, Path(folder)), show, overwrite=overwrite)

    def whoami(self) -> Json:
        return object_of(self._get("/v1/whoami"))

    def usage(self) -> Usage:
        return read(Usage, self._get("/v1/usage"))

    def capabilities(self) -> Json:
        return object_of(self._get("/v1/capabilities"))

    def create_key(
        self, tenant: str, *, name: str = "", scopes: list[str] | None = None, expires_in_s: float | None = None
    ) -> Key:
        """Create a key; the answer's `key` is shown this once."""
        optional = {"scopes": scopes, "expires_in_s": expires_in_s}
        body = {"tenant": tenant, "name": name} | {name: value for name, value in optional.items() if value is not None}
        return read(Key, json_of(self._transport.request("POST", "/v1/keys", body=body)))

    def list_keys(self) -> Iterator[Key]:
        return self._pages("/v1/keys", {}, Key)

    def revoke_key(self, key_id: str) -> None:
        self._transport.request("DELETE", f"/v1/keys/{quote(key_id, safe='')}")

    def _get(self, path: str, params: Mapping[str, Any] | None = None) -> Any:
        return json_of(self._transport.request("GET", path, params=params, headers={"Accept": "application/json"}))

    def _pages(self, path: str, params: Mapping[str, Any], kind: type[T]) -> Iterator[T]:
        return (read(kind, item) for item in self._items(path, params))

    def _items(self, path: str, params: Mapping[str, Any]) -> Iterator[Any]:
        """Yield the items of all pages; a page is requested when it is needed."""
        cursor: str | None = None
        while True:
            page = self._get(path, {**params, **({"limit": PAGE_ITEMS, "cursor": cursor} if cursor else {})})
            yield from items_of(page)
            cursor = page.get("next_cursor") if isinstance(page, dict) else None
            if cursor is None:
                return


def _deadline(timeout_s: float | None) -> float | None:
    return None if timeout_s is None else time.monotonic() + timeout_s


def _check(deadline: float | None, message: str) -> None:
    if deadline is not None and time.monotonic() > deadline:
        raise TimedOut(message)
