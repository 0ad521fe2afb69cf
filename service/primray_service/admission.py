"""Admission of a request as a job: limits are checked before anything is created, then the renderer's own checks. Pure.

The stop rules of a continued job are derived here from its earlier ones.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from decimal import Decimal, DecimalException
from operator import attrgetter
from typing import Any

from primray.aovs import DEEP
from primray.errors import LimitError, PrimrayError, SettingsError
from primray.images.encoding import Encoding, compression_of
from primray.render.frames import parse_frames
from primray.settings import DEFAULT_SPP, RenderSettings, files_of_jobs, rows

from . import ids
from .api.models import ContinuedRules, JobPatch, JobRequest, SceneOfRequest, Settings, StopRules
from .jobs import Job, JobState, Json
from .limits import Limits
from .problems import Problem

_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*(?:[:-]\s*({_NUMBER})\s*(?:[x:]\s*({_NUMBER}))?)?\s*", re.ASCII)
# Members of the API's settings, by fields of RenderSettings.
MEMBERS = {row.name: row.member.name or row.name for row in rows(RenderSettings) if row.member is not None}

BEAUTY = "beauty"  # name of the product that every scene has
ALL = "*"  # selects all products


def over_limit(member: str, detail: str, limit: float) -> Problem:
    return Problem("limit-exceeded", f"{member}: {detail}.", member=member, limit=limit)


def invalid(member: str, detail: str) -> Problem:
    return Problem("invalid-request", f"{member}: {detail.rstrip('.')}.", member=member)


def new_job(
    request: JobRequest, scene_id: str, tenant: str, limits: Limits, now: float, *, request_id: str = "", traceparent: str = ""
) -> tuple[Job, list[float | None]]:
    """Return a queued job and its frames' time codes; raise Problem with the member at fault."""
    check_labels(request.labels, limits)
    times = time_codes(request.settings.frames, limits)
    check_settings(request.settings, limits)
    check_parallel(request)
    ttl_s = checked_ttl(request.ttl_s, limits)
    job = Job(
        id=ids.job_id(now),
        tenant=tenant,
        state=JobState.QUEUED,
        scene_id=scene_id,
        entry=request.scene.entry,
        settings=request.settings.model_dump(mode="json"),
        created_at=now,
        queued_at=now,
        expires_at=now + ttl_s,
        ttl_s=ttl_s,
        priority=request.priority,
        labels=request.labels,
        name=request.name,
        parallel=request.parallel,
        webhook=None if request.webhook is None else request.webhook.model_dump(mode="json"),
        progress=first_progress(len(times)),
        request_id=request_id,
        traceparent=traceparent,
    )
    return job, times


def first_progress(frames: int) -> Json:
    counts = {"total": frames, "queued": frames, "running": 0, "succeeded": 0, "failed": 0, "canceled": 0}
    return {"fraction": 0.0, "phase": "queued", "frames": counts}


def time_codes(text: str | None, limits: Limits) -> list[float | None]:
    """Return a job's frames; they are counted before they are listed."""
    if text is None:
        return [None]
    member, count = "settings.frames", 0
    for part in text.split(","):
        match = _RANGE.fullmatch(part)
        if match is None:
            continue  # the parser reports the error
        first, last, step = match.groups()
        count += 1 if last is None else _count(first, last, step, limits)
        if count > limits.frames:
            raise over_limit(member, f"at most {limits.frames} frames are allowed", limits.frames)
    try:
        frames = parse_frames(text)
    except LimitError:
        raise over_limit(member, f"at most {limits.frames} frames are allowed", limits.frames) from None
    except SettingsError as error:
        raise invalid(member, error.message) from None
    if len(frames) > limits.frames:
        raise over_limit(member, f"at most {limits.frames} frames are allowed", limits.frames)
    if len(set(frames)) < len(frames):
        twice = next(frame for frame in frames if frames.count(frame) > 1)
        raise invalid(member, f"frame {twice:g} is requested twice")
    return list(frames)


def _count(first: str, last: str, step: str | None, limits: Limits) -> int:
    """Return the number of frames, or the limit plus one where there are more, so that no number grows large."""
    try:
        steps = (Decimal(last) - Decimal(first)).copy_abs() / Decimal(step or 1).copy_abs()
    except DecimalException:
        return 1 if Decimal(step or 1) == 0 else limits.frames + 1  # the parser refuses a step of 0
    return int(min(steps, Decimal(limits.frames))) + 1


def check_settings(settings: Settings, limits: Limits) -> None:
    """Check this server's limits, then what the renderer itself checks."""
    check_products(settings)
    if DEEP in (settings.aovs or ()):
        raise invalid("settings.aovs", f"{DEEP} needs a render without checkpoints; render it by the command line")
    for member, path in (
        ("render_settings", settings.render_settings),
        ("render_pass", settings.render_pass),
    ):
        if path is not None and not path.startswith("/"):
            raise invalid(f"settings.{member}", f"{path!r} is not a prim path, which begins with /")
    if settings.resolution is not None:
        width, height = settings.resolution
        member = "settings.resolution"
        if max(width, height) > limits.image_side:
            raise over_limit(member, f"at most {limits.image_side} pixels per side are allowed", limits.image_side)
        if width * height > limits.image_pixels:
            raise over_limit(member, f"at most {limits.image_pixels} pixels are allowed", limits.image_pixels)
    check_stop(settings.stop, limits, "settings.stop")
    check_denoising(settings)
    try:
        render_settings(settings)
    except LimitError as error:
        raise Problem("limit-exceeded", f"{_member(error)}: {error.message}.", member=_member(error)) from None
    except SettingsError as error:
        raise invalid(_member(error), error.message) from None
    check_files(settings)


def check_products(settings: Settings) -> None:
    """Raise Problem unless `products` is the first product, all of them, or distinct products by path."""
    names = settings.products
    if len(names) > 1 and (ALL in names or BEAUTY in names):
        listed = f'["{BEAUTY}"] selects the first product and ["{ALL}"] all of them; list several by their paths'
        raise invalid("settings.products", listed)
    if len(set(names)) < len(names):
        raise invalid("settings.products", "a product is named twice")
    for name in names:
        if not name or ("/" in name and not name.startswith("/")):
            raise invalid(
                "settings.products", f"{name!r} is neither the path of a RenderProduct, which begins with /, nor a name"
            )


def products_by_name(settings: Mapping[str, Any]) -> list[str] | None:
    """Return the products of a job's settings that are written under their own names: ["*"] or paths; None: one picture."""
    names: list[str] = settings.get("products") or [BEAUTY]
    return names if names == [ALL] or len(names) > 1 else None


def check_files(settings: Settings) -> None:
    """Raise Problem for an EXR compression that does not exist, and for images outside the package."""
    try:
        Encoding(None, tuple(settings.half), *compression_of(settings.compression))
    except SettingsError as error:
        raise invalid("settings.compression", error.message) from None
    for member in files_of_jobs(RenderSettings):
        name = getattr(settings, member)
        if name is not None and (name.startswith("/") or ".." in name.split("/") or "\\" in name or "\0" in name):
            raise invalid(f"settings.{member}", f"{name!r} is not the name of a file in the package")


def check_parallel(request: JobRequest) -> None:
    """Raise Problem for settings that frames in parts cannot honour: each part takes a range of samples of every pixel, which
    excludes adaptive sampling."""
    if request.parallel is not None and request.settings.adaptive:
        why = "a frame that is rendered in several places has the same samples in each pixel; leave out adaptive, or parallel"
        raise Problem("parallel-adaptive", f"parallel: {why}.", member="parallel")
    if request.parallel is not None and request.settings.stop_at == "denoised":
        why = "a frame in parts is judged by the picture's own error, not by a denoised one's; leave out stop_at, or parallel"
        raise Problem("parallel-denoise", f"parallel: {why}.", member="parallel")
    if request.parallel is not None and products_by_name(request.settings.model_dump()) is not None:
        why = "a frame in parts is one picture; send a job for each product, or leave out parallel"
        raise Problem("unsupported-setting", f"parallel: {why}.", member="parallel")


def check_denoising(settings: Settings) -> None:
    if settings.stop_at == "denoised" and settings.stop.target_error is None:
        raise invalid("settings.stop_at", "a frame stops at an error of its denoised picture: name it by stop.target_error")
    if settings.stop_at == "mix" and settings.stop.target_error is None:
        raise invalid("settings.stop_at", "a frame stops at an error of a mix of its lights: name it by stop.target_error")


def check_stop(stop: StopRules, limits: Limits, member: str) -> None:
    if stop.max_samples is not None and stop.max_samples > limits.samples:
        raise over_limit(f"{member}.max_samples", f"at most {limits.samples} samples per pixel are allowed", limits.samples)
    if stop.max_seconds is not None and stop.max_seconds > limits.seconds:
        raise over_limit(f"{member}.max_seconds", f"at most {limits.seconds:.0f} seconds are allowed", limits.seconds)


def render_settings(settings: Settings) -> RenderSettings:
    """Return the settings of a frame's worker, except its time code and its share of the machine."""
    values = {name: attrgetter(member)(settings) for name, member in MEMBERS.items() if name != "product"}
    given: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    return RenderSettings(**given, product=_product(settings))


def _product(settings: Settings) -> str | None:
    """Return the RenderProduct that is named; None for the first one, and where several are made."""
    name = settings.products[0]
    return None if len(settings.products) > 1 or name in (BEAUTY, ALL) else name


def _member(error: PrimrayError) -> str:
    """Return the member of the request whose value a field of RenderSettings, `error.where`, refuses."""
    return f"settings.{MEMBERS.get(error.where, error.where)}" if error.where else "settings"


def check_labels(labels: Mapping[str, str], limits: Limits) -> None:
    if len(labels) > limits.labels:
        raise over_limit("labels", f"at most {limits.labels} labels are allowed", limits.labels)
    for name, value in labels.items():
        if not name or ":" in name or "=" in name:
            raise invalid("labels", "a label's name needs at least one character, without : and =")
        if max(len(name), len(value)) > limits.label_chars:
            raise over_limit("labels", f"at most {limits.label_chars} characters are allowed", limits.label_chars)


def checked_ttl(ttl_s: float | None, limits: Limits) -> float:
    if ttl_s is not None and ttl_s > limits.ttl_s:
        raise over_limit("ttl_s", f"at most {limits.ttl_s:.0f} seconds are allowed", limits.ttl_s)
    return limits.default_ttl_s if ttl_s is None else ttl_s


def changes_of(patch: JobPatch, limits: Limits) -> Json:
    """Return the changes that a PATCH requests, in the store's form."""
    changes = patch.model_dump(mode="json", exclude_unset=True)
    if "labels" in changes:
        check_labels(changes["labels"], limits)
    if "ttl_s" in changes:
        changes["ttl_s"] = checked_ttl(patch.ttl_s, limits)
    return changes


# Members added since version 0.2.0: at their defaults they do not count in a request's fingerprint, so that an old request with
# the same key still matches.
NEW_MEMBERS = ("name", "parallel")
NEW_OF_SCENE = ("shared",)
SETTINGS_OF_0_2 = (
    *("camera", "render_settings", "products", "aovs", "frames", "resolution", "stop", "seed", "max_depth", "adaptive"),
    *("filter", "filter_width", "default_light", "purposes", "strict", "dicing_rate", "variants", "load", "mask"),
)


def _as_of_old(settings: Json) -> None:
    """Restore the values that versions before 0.3 wrote for omitted members, so that their keys still match the same
    request."""
    settings["filter"] = settings["filter"] or "box"
    settings["stop"]["metric"] = settings["stop"]["metric"] or "relmse"


def fingerprint(request: JobRequest) -> str:
    """Return a digest that is equal for equivalent requests, however their JSON is written."""
    said = request.model_dump(mode="json")
    _as_of_old(said["settings"])
    for members, model, names in (
        (said, JobRequest, NEW_MEMBERS),
        (said["scene"], SceneOfRequest, NEW_OF_SCENE),
        (said["settings"], Settings, [name for name in said["settings"] if name not in SETTINGS_OF_0_2]),
    ):
        for name in names:
            if members[name] == model.model_fields[name].default:
                del members[name]
    text = json.dumps(said, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


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
