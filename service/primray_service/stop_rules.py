"""Stop rules of a continued job, derived from its earlier ones. Pure."""

from __future__ import annotations

from primray.settings import DEFAULT_SPP

from .admission import check_stop, invalid
from .api.models import ContinuedRules, StopRules
from .jobs import Job, JobState, Json
from .limits import Limits

RULES = ("target_error", "max_samples", "max_seconds")


def continued(job: Job, asked: ContinuedRules, limits: Limits) -> Json:
    """Return the rules of the next attempt; raises Problem if a job that succeeded would end where it did before.

    A job that succeeded needs more: some rule goes further than before, none less far. One that did not succeed may continue
    with its own rules, or any others.
    """
    before = StopRules.model_validate_json(StopRules(**job.settings.get("stop", {})).model_dump_json())
    after = StopRules(**{**before.model_dump(), **asked.model_dump(exclude_unset=True)})
    check_stop(after, limits, "stop")
    if job.state is JobState.SUCCEEDED:
        _check_further(before, after)
    return after.model_dump(mode="json")


def _check_further(before: StopRules, after: StopRules) -> None:
    is_other_metric = (after.metric or "relmse") != (before.metric or "relmse")
    if is_other_metric and before.target_error is not None and after.target_error is not None:
        return  # errors in two metrics cannot be compared
    further = {rule: _further(rule, before, after) for rule in RULES}
    shorter = next((rule for rule in RULES if further[rule] < 0), None)
    if shorter is not None:
        raise invalid(f"stop.{shorter}", "the job has already reached this")
    if not any(further.values()):
        raise invalid("stop", "the job succeeded; give a lower target_error, or a higher max_samples or max_seconds")


def _further(rule: str, before: StopRules, after: StopRules) -> int:
    """Return whether the rule stops later than before: 1, 0 for the same, -1 for sooner."""
    old, new = _bound(rule, before), _bound(rule, after)
    if old == new or (new is not None and old is None):
        # A rule that is added to others does not restrict them: if it is reached already, the frame just ends.
        return 0 if old == new else int(rule == "target_error")
    if new is None:
        return 1
    assert old is not None
    later = new < old if rule == "target_error" else new > old
    return 1 if later else -1


def _bound(rule: str, rules: StopRules) -> float | None:
    value: float | None = getattr(rules, rule)
    if rule == "max_samples" and all(getattr(rules, other) is None for other in RULES):
        return float(DEFAULT_SPP)
    return value
