"""Any history of a job is legal: hypothesis plays clients, dispatchers, their deaths, and time, over a real database."""

from __future__ import annotations

import itertools
import tempfile
from dataclasses import replace
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from primray_service.jobs import MOVES, TERMINAL, FrameState, Job, JobState, is_legal, state_of_all
from primray_service.store import open_store
from primray_service.store.base import Claim, Conflict, QuotaExceeded

from .world import ANY, World, any_quotas, broken_rules, new_job, new_scene, scene_id

frame_states = st.sampled_from(list(FrameState))


@given(st.lists(frame_states, min_size=1, max_size=8))
def test_frames_add_up_to_a_state(states: list[FrameState]):
    total = state_of_all(states)
    ended = {FrameState.SUCCEEDED, FrameState.FAILED, FrameState.CANCELED}
    assert (total is None) == bool(set(states) - ended)
    if total is not None:
        assert total in TERMINAL
        assert (total == JobState.SUCCEEDED) == (set(states) == {FrameState.SUCCEEDED})
        assert (total == JobState.CANCELED) == (FrameState.CANCELED in states)


def test_terminal_states_lead_only_to_a_new_attempt():
    for state, to in itertools.product(JobState, JobState):
        assert is_legal(state, to) == (to in MOVES[state])
        if state in TERMINAL:
            assert is_legal(state, to) == (to == JobState.QUEUED)
    for state in JobState:  # from anywhere to an end, so that no job is stuck
        assert state in TERMINAL or MOVES[state] & (TERMINAL | {JobState.CANCELING})
    for state in set(JobState) - TERMINAL - {JobState.CANCELING}:  # whatever runs or waits can be paused
        assert state == JobState.PAUSED or JobState.PAUSED in MOVES[state]


class Histories(RuleBasedStateMachine):
    """Claims of dispatchers that are dead are kept: what they still say is to be dropped."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory()
        store = open_store(f"sqlite:///{self.folder.name}/h.sqlite")
        store.migrate()
        self.world = World(store)
        self.jobs: list[Job] = []
        self.claims: list[tuple[int, Claim]] = []
        self.holders = itertools.count()
        self.seen: dict[str, Job] = {}

    def teardown(self) -> None:
        self.world.store.close()
        self.folder.cleanup()

    @initialize()
    def begin(self) -> None:
        self.world.lead("d")
        self.world.store.put_scene(new_scene(), ANY)

    def pick(self, number: int) -> Job:
        return self.jobs[number % len(self.jobs)]

    @rule(frames=st.integers(1, 3), priority=st.integers(0, 2), ttl_s=st.sampled_from([30.0, 1e6]))
    def create(self, frames: int, priority: int, ttl_s: float) -> None:
        job = new_job(at=self.world.tick(), priority=priority, ttl_s=ttl_s)
        self.jobs.append(self.world.store.create_job(job, [None] * frames, ANY)[0])

    @rule(ok=st.booleans())
    def check(self, ok: bool) -> None:
        problem = None if ok else {"type": "/problems/not-usd"}
        self.world.store.scene_checked(self.world.fence, scene_id(), self.world.tick(), facts={}, warnings=[], problem=problem)

    @rule()
    def claim(self) -> None:
        claim = self.world.store.claim_frame(self.world.fence, self.world.tick(), any_quotas)
        if claim is not None:
            self.claims.append((self.world.fence, claim))

    @precondition(lambda self: self.claims)
    @rule(number=st.integers(0, 50), says=st.sampled_from(["runs", "checkpoint", "gives way", *FrameState]))
    def say(self, number: int, says: str) -> None:
        fence, claim = self.claims[number % len(self.claims)]
        frame, now = replace(claim.frame, cpu_s=claim.frame.cpu_s + 1.5), self.world.tick()
        store = self.world.store
        call: Any = None
        if says == "runs":
            call = lambda: store.report(fence, frame, now, job_changes={"state": JobState.RUNNING})  # noqa: E731
        elif says == "checkpoint":
            given: Any = {"attempt": frame.attempt, "follows": frame.checkpoint, "file": "f", "now": now}
            call = lambda: store.accept_checkpoint(fence, f"c{number}", frame.job_id, frame.number, **given)  # noqa: E731
        elif says == "gives way":
            call = lambda: store.requeue_frame(fence, frame, now)  # noqa: E731
        elif says in (FrameState.SUCCEEDED, FrameState.FAILED, FrameState.CANCELED):
            ended = replace(frame, state=FrameState(says))
            call = lambda: store.end_frame(fence, ended, now, outputs=[], job_changes={})  # noqa: E731
        if call is not None:
            self.late_or_lost(call, fence)

    def late_or_lost(self, call: Any, fence: int) -> None:
        from primray_service.store.base import Lost

        try:
            call()
        except Lost:
            assert fence != self.world.fence
        except KeyError:  # the job was deleted
            pass
        else:
            assert fence == self.world.fence

    @precondition(lambda self: self.jobs)
    @rule(
        number=st.integers(0, 50),
        does=st.sampled_from(["cancel", "continue", "delete", "priority", "pause", "resume", "retry"]),
    )
    def client(self, number: int, does: str) -> None:
        job, now, store = self.pick(number), self.world.tick(), self.world.store
        before = store.job(job.id)
        if before is None:
            return
        try:
            if does == "cancel":
                assert store.request_cancel(job.id, now).state in (JobState.CANCELED, JobState.CANCELING)
            elif does == "continue":
                assert store.continue_job(job.id, {"n": now}, now, ANY).attempt == before.attempt + 1
            elif does == "pause":
                assert store.request_pause(job.id, now).state in (JobState.PAUSED, JobState.PAUSING)
            elif does == "resume":
                assert store.request_resume(job.id, now).state not in (JobState.PAUSED, JobState.PAUSING)
            elif does == "retry":
                frame = store.frame(job.id, 0)
                assert frame is not None
                assert store.retry_frame(job.id, 0, frame.attempt, now, ANY).attempt == before.attempt
            elif does == "delete":
                assert store.delete_job(job.id)
                self.jobs.remove(job)
            else:
                store.update_job(job.id, now, version=before.version, changes={"priority": number})
        except Conflict:
            assert does != "priority"
            assert store.job(job.id) == before
        except QuotaExceeded:
            raise AssertionError("there is none") from None

    @rule()
    def dies(self) -> None:
        self.world.tick(1e7)
        self.world.lead(f"d{next(self.holders)}")

    @rule(seconds=st.sampled_from([1.0, 40.0, 2e6]))
    def time_goes_on(self, seconds: float) -> None:
        expired, ended = self.world.store.expire(self.world.fence, self.world.tick(seconds), 2)
        assert all(job.state == JobState.EXPIRED for job in expired)
        for job_id in ended:
            assert self.world.store.delete_job(job_id)
            self.jobs = [job for job in self.jobs if job.id != job_id]

    @invariant()
    def all_rules_hold(self) -> None:
        assert not broken_rules(self.world.store)
        for job in self.jobs:
            now = self.world.get(job)
            before = self.seen.get(job.id, now)
            assert (now.revision, now.version) >= (before.revision, before.version)
            assert now == before or now.revision > before.revision
            assert (now.state, now.priority) == (before.state, before.priority) or now.version > before.version
            self.seen[job.id] = now


TestHistories = Histories.TestCase
TestHistories.settings = settings(
    max_examples=20, stateful_step_count=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
