"""What needs no server: keys, buckets, digests, names, which layer is meant, secrets in logs, tracing that is off."""

from __future__ import annotations

import io
import json
import logging
from typing import Any

import pytest
import structlog

from primray_service.access import keys
from primray_service.access.quotas import RequestRates
from primray_service.limits import Quotas
from primray_service.problems import Problem
from primray_service.scenes.entries import candidates, choose
from primray_service.telemetry import logs, tracing


def test_a_key_holds_256_bits_and_tells_mistakes() -> None:
    text = keys.make(bytes(range(32)))
    assert text == keys.make(bytes(range(32)))
    assert len({keys.make() for _ in range(100)}) == 100
    assert keys.is_whole(text)
    for wrong in (text[:-1], text + "a", text.replace("A", "B"), text.upper(), "", text.replace("primray_", "primray-")):
        assert not keys.is_whole(wrong)
    with pytest.raises(ValueError, match="32"):
        keys.make(b"short")


def test_a_bucket_fills_at_its_rate_and_no_further() -> None:
    now = 0.0
    rates = RequestRates(lambda: now)
    quotas = Quotas(requests_per_s=2.0, burst=3)

    def take() -> Any:
        return rates.take("key", quotas)

    assert [take().is_allowed for _ in range(4)] == [True, True, True, False]
    refused = take()
    assert (refused.remaining, refused.retry_after_s, refused.reset_s) == (0, 1, 2)
    now = 0.5
    assert [take().is_allowed for _ in range(2)] == [True, False]
    now = 100.0
    assert [take().is_allowed for _ in range(4)] == [True, True, True, False]
    assert rates.take("another", quotas).is_allowed  # type: ignore[union-attr]
    assert rates.take("key", Quotas(requests_per_s=None)) is None


def test_buckets_do_not_grow_without_end() -> None:
    now = 0.0
    rates = RequestRates(lambda: now)
    for number in range(25_000):
        now += 0.01
        rates.take(f"key {number}", Quotas(requests_per_s=50.0, burst=2))
    assert len(rates._buckets) <= 10_001


@pytest.mark.parametrize(
    ("paths", "roots"),
    [
        (["shot.usda", "assets/a.usd", "tex/a.png"], ["shot.usda"]),
        (["show/shot.usda", "show/assets/a.usd", "readme.txt"], ["show/shot.usda"]),
        (["a.usda", "b.USDC", "c.usdz", "d/e.usda"], ["a.usda", "b.USDC", "c.usdz"]),
        (["__MACOSX/._a.usda", ".hidden/b.usda", "x/y/a.usda"], ["x/y/a.usda"]),
        (["a.png"], []),
    ],
)
def test_the_outermost_layers_can_be_the_root(paths: list[str], roots: list[str]) -> None:
    assert candidates(paths) == roots


def test_the_entry_is_the_one_named_or_the_only_one() -> None:
    assert choose(None, ["a.usda"]) == "a.usda"
    assert choose("d/e.usda", ["a.usda"], ["a.usda", "d/e.usda"]) == "d/e.usda"
    with pytest.raises(Problem) as ambiguous:
        choose(None, ["a.usda", "b.usda"])
    assert (ambiguous.value.slug, ambiguous.value.extra["candidates"]) == ("ambiguous-entry", ["a.usda", "b.usda"])
    with pytest.raises(Problem) as missing:
        choose("c.usda", ["a.usda", "b.usda"])
    assert missing.value.slug == "entry-missing"


SECRETS = {
    "authorization": "Bearer abc.def",
    "detail": "sent primray_" + "Ab1-" * 11 + " and whsec_c2VjcmV0c2VjcmV0c2VjcmV0 to postgresql+psycopg://user:pass@db/x",
    "nested": {"cookie": "primray_session=1", "list": ["bearer xyz", {"key": "k"}]},
}


@pytest.fixture
def _logging_as_it_was() -> Any:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = handlers, level
    structlog.reset_defaults()


@pytest.mark.usefixtures("_logging_as_it_was")
def test_the_log_is_a_line_of_json_without_secrets() -> None:
    stream = io.StringIO()
    logs.configure(True, stream)
    structlog.get_logger("x").info("request", **SECRETS, job_id="job_1")
    logging.getLogger("uvicorn.error").warning("from elsewhere: %s", "Bearer abcdef")
    try:
        raise ValueError("primray_" + "Ab1-" * 11)
    except ValueError:
        structlog.get_logger("x").exception("failed")
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["event"] for line in lines] == ["request", "from elsewhere: [hidden]", "failed"]
    assert lines[0]["job_id"] == "job_1"
    assert lines[0]["detail"] == "sent [hidden] and [hidden] to postgresql+psycopg://[hidden]@db/x"
    assert lines[0]["nested"] == {"cookie": "[hidden]", "list": ["[hidden]", {"key": "[hidden]"}]}
    assert lines[2]["exception"][0]["exc_type"] == "ValueError"
    for secret in ("abc.def", "Ab1-", "whsec_", "user:pass", "xyz", "session=1"):
        assert secret not in stream.getvalue()


@pytest.mark.usefixtures("_logging_as_it_was")
def test_the_log_for_people_is_readable() -> None:
    stream = io.StringIO()
    logs.configure(False, stream)
    structlog.get_logger("x").info("request", path="/v1/jobs", key="secret")
    assert "request" in stream.getvalue()
    assert "path=/v1/jobs" in stream.getvalue()
    assert "secret" not in stream.getvalue()


def test_nothing_is_traced_unless_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_TRACES_EXPORTER"):
        monkeypatch.delenv(name, raising=False)
    assert tracing.instrument(object()) == ""
    monkeypatch.setenv("OTEL_TRACES_EXPORTER", "console")
    assert tracing.is_wanted()
    monkeypatch.setenv("OTEL_SDK_DISABLED", "true")
    assert not tracing.is_wanted()
