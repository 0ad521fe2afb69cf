"""--limit: every field there is, in the units that people write."""

from __future__ import annotations

from dataclasses import fields

import pytest

from primray_service.cli.exits import CommandError
from primray_service.cli.limit_options import limits_of, lines, quota_of
from primray_service.limits import Limits, Quotas


def test_every_field_can_be_given_back_as_it_is_listed() -> None:
    listed = [line.split() for line in lines() if len(line.split()) == 2]
    assert {name for name, _ in listed} == {field.name for kind in (Limits, Quotas) for field in fields(kind)}
    limits, quotas = limits_of([f"{name}={value}" for name, value in listed])
    assert (limits, quotas) == (Limits(), Quotas())


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("upload_bytes=4G", "upload_bytes", 4 * 2**30),
        ("upload-bytes = 4GiB", "upload_bytes", 4 * 2**30),
        ("memory_bytes=1.5g", "memory_bytes", 3 * 2**29),
        ("log_bytes=100", "log_bytes", 100),
        ("seconds=2h", "seconds", 7200.0),
        ("ttl_s=30d", "ttl_s", 30 * 86400.0),
        ("stop_grace_s=.5", "stop_grace_s", 0.5),
        ("image_pixels=8M", "image_pixels", 8_000_000),
        ("unpack_ratio=50", "unpack_ratio", 50.0),
    ],
)
def test_limits(text: str, name: str, value: float) -> None:
    limits, quotas = limits_of([text])
    assert getattr(limits, name) == value
    assert type(getattr(limits, name)) is type(getattr(Limits(), name))
    assert quotas == Quotas()


def test_quotas() -> None:
    limits, quotas = limits_of(["running_jobs=3", "queued_jobs=none", "cpu_s_per_day=10h", "requests_per_s=2.5"])
    assert quotas == Quotas(running_jobs=3, queued_jobs=None, cpu_s_per_day=36_000.0, requests_per_s=2.5)
    assert limits == Limits()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("upload_bytes", "--limits"),
        ("no_such=1", "--limits"),
        ("upload_bytes=", "number"),
        ("upload_bytes=4X", "2G"),
        ("upload_bytes=-1", "number"),
        ("upload_bytes=nan", "number"),
        ("upload_bytes=1e9", "number"),
        ("upload_bytes=none", "cannot be removed"),
        ("layers=1.5", "whole"),
        ("upload_bytes=99999999999999999999", "whole"),
        ("seconds=5G", "2h"),
    ],
)
def test_what_is_none(text: str, says: str) -> None:
    with pytest.raises(CommandError) as caught:
        limits_of([text])
    assert caught.value.exit_code == 2
    assert says in caught.value.message


def test_quotas_of_a_tenant_have_the_same_units() -> None:
    assert quota_of("stored_bytes", "3M") == 3 * 2**20
    assert quota_of("cpu_s_per_day", "2h") == 7200
    assert quota_of("requests_per_s", "0.5") == 0.5
    assert quota_of("running_jobs", "none") is None
    with pytest.raises(CommandError, match="--stored-bytes 3X: write a number, such as 2 or 2K, 2M, 2G, 2T, or none") as wrong:
        quota_of("stored_bytes", "3X")
    assert (wrong.value.code, wrong.value.exit_code) == ("quotas", 2)
