"""deploy/monitoring: as Prometheus reads it, and against the metrics that a real server exports, by name, label and value."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]
from prometheus_client.parser import text_string_to_metric_families
from tests.service.api_calls import finished, submit, upload, wait_until
from tests.service.serving import start

from primray_service.jobs import JobState
from primray_service.problems import KINDS

from .manifests import ROOT

FOLDER = ROOT / "deploy/monitoring"
RULES: dict[str, Any] = yaml.safe_load((FOLDER / "alerts.yaml").read_text())
DASHBOARD: dict[str, Any] = json.loads((FOLDER / "dashboard.json").read_text())
ALERTS: list[dict[str, Any]] = [rule for group in RULES["groups"] for rule in group["rules"]]
OF_PROMETHEUS = {"up": {"job", "instance"}}  # made by Prometheus for each target, as these two labels are for each series
FUNCTIONS = {"and", "by", "on", "sum", "max", "min", "count", "rate", "increase", "histogram_quantile", "topk"}
LABELS = {"le", "job", "instance", "version", "state", "reason", "result", "status", "method", "route"}
WORDS = FUNCTIONS | LABELS
Exported = dict[str, set[str]]


def targets() -> list[dict[str, Any]]:
    return [target for panel in DASHBOARD["panels"] for target in panel.get("targets", ())]


def panels_expressions() -> list[str]:
    """The dashboard's, with Grafana's variables filled in."""
    return [target["expr"].replace("$__rate_interval", "5m").replace("$job", ".+") for target in targets()]


def expressions() -> list[str]:
    return [rule["expr"] for rule in ALERTS] + panels_expressions()


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """Labels by the names of series, of a server that has rendered a frame."""
    server = start(tmp_path_factory.mktemp("watched") / "data")
    try:
        client = server.client()
        assert finished(client, submit(client, upload(client))["id"])["state"] == "succeeded"
        # The answer that the job has ended may be read before the dispatcher counts its frame.
        wait_until(lambda: 'primray_frames_ended_total{reason="succeeded"} 1.0' in client.get("/metrics").text)
        families = list(text_string_to_metric_families(client.get("/metrics").text))
    finally:
        server.stop()
    found: Exported = {}
    for family in families:
        found.setdefault(f"{family.name}_total" if family.type == "counter" else family.name, set())
        for sample in family.samples:
            found.setdefault(sample.name, set()).update(sample.labels)
    found["primray_frames_restarted_total"].add("reason")  # no frame was
    return found


def used(expression: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Each series that it names, with its matchers; a word that is neither is an error."""
    bare = re.sub(r'"[^"]*"', '""', expression)
    for word in re.findall(r"(?<![\w.\[])[a-z_]\w*", bare):
        assert word.startswith("primray_") or word in OF_PROMETHEUS or word in WORDS, (word, expression)
    for name, matchers in re.findall(r'\b(primray_\w+|up)\b(?:\{((?:[^"}]|"[^"]*")*)\})?', expression):
        yield name, dict(re.findall(r'(\w+)(?:=~|!~|!=|=)"([^"]*)"', matchers))


def test_every_series_is_exported_with_its_labels(exported: Exported) -> None:
    assert len(expressions()) > 40
    for expression in expressions():
        series = list(used(expression))
        assert series, expression
        labels = set().union(*({"job", "instance"} | exported.get(name, OF_PROMETHEUS.get(name, set())) for name, _ in series))
        for name, matchers in series:
            known = exported.get(name, OF_PROMETHEUS.get(name))
            assert known is not None, name
            assert set(matchers) <= known | {"job", "instance"}, expression
        for clause in re.findall(r"\b(?:by|on) \(([^)]*)\)", expression):
            assert {label.strip() for label in clause.split(",")} <= labels, expression


def test_a_name_that_is_not_exported_is_found(exported: Exported) -> None:
    assert "primray_frames_begun_total" not in exported
    assert [name for name, _ in used('rate(primray_frames_begun_total{job="a"}[5m])')] == ["primray_frames_begun_total"]
    with pytest.raises(AssertionError, match="quantil"):
        list(used("quantil(0.5, up)"))


def test_the_dashboard_shows_every_metric_of_the_service(exported: Exported) -> None:
    """Or says here why not."""
    shown = {re.sub(r"_(bucket|count|sum)$", "", name) for each in panels_expressions() for name, _ in used(each)}
    families = {re.sub(r"_(bucket|count|sum)$", "", name) for name in exported if not name.endswith("_created")}
    of_process = {name for name in families | shown if name.startswith("primray_process_")}
    told_by_others = {"primray_frames_started_total", "primray_jobs_deleted_total"}  # ends, and the queue
    assert families - of_process - told_by_others == shown - of_process


def test_values_of_labels_are_those_that_there_are() -> None:
    reasons = {*KINDS, *(state.value for state in JobState), "yield", "shutdown"}
    known = {"state": {state.value for state in JobState}, "reason": reasons}
    for expression in expressions():
        for _, matchers in used(expression):
            for label, values in matchers.items():
                assert set(values.split("|")) <= known.get(label, set(values.split("|"))), expression


def test_the_dashboard_is_whole() -> None:
    """What Grafana does not say when it is imported: panels that overlap, ids twice, variables that nobody defines."""
    panels = DASHBOARD["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    cells: set[tuple[int, int]] = set()
    for panel in panels:
        place = panel["gridPos"]
        assert place["x"] + place["w"] <= 24
        taken = {(x, y) for x in range(place["x"], place["x"] + place["w"]) for y in range(place["y"], place["y"] + place["h"])}
        assert not taken & cells, panel["title"]
        cells |= taken
        assert panel["type"] in ("row", "stat", "timeseries")
        assert panel["type"] == "row" or panel["targets"]
    variables = {each["name"] for each in DASHBOARD["templating"]["list"]}
    used_variables = set(re.findall(r"\$\{?(\w+)", json.dumps([panels, DASHBOARD["templating"]]))) - {
        "__rate_interval",
        "__all",
    }
    assert used_variables <= variables


def test_each_alert_says_what_is_wrong_and_what_to_do() -> None:
    assert len({rule["alert"] for rule in ALERTS}) == len(ALERTS)
    for rule in ALERTS:
        assert set(rule) <= {"alert", "expr", "for", "labels", "annotations"}
        assert rule["labels"]["severity"] in ("critical", "warning")
        assert set(rule["annotations"]) == {"summary", "description"}


def promtool(*arguments: str, folder: Path) -> str:
    program = shutil.which("promtool")
    if program is None:
        pytest.skip("skipped: no promtool")
    done = subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for file in (*FOLDER.glob("*.yaml"), Path(__file__).with_name("alerts_test.yaml")):
        shutil.copy(file, tmp_path)
    (tmp_path / "primray.key").touch()
    return tmp_path


def test_prometheus_takes_the_configuration_and_the_rules(folder: Path) -> None:
    said = promtool("check", "config", "prometheus.yaml", folder=folder)
    assert f"{len(ALERTS)} rules found" in said


def test_alerts_fire_when_they_should(folder: Path) -> None:
    promtool("test", "rules", "alerts_test.yaml", folder=folder)


def test_prometheus_takes_the_dashboards_expressions(folder: Path) -> None:
    rules = [{"record": f"panel:{number}", "expr": expression} for number, expression in enumerate(expressions())]
    (folder / "panels.yaml").write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    promtool("check", "rules", "panels.yaml", folder=folder)
    rules[0]["expr"] = "sum by (job (up)"
    (folder / "panels.yaml").write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    with pytest.raises(AssertionError, match="parse error"):
        promtool("check", "rules", "panels.yaml", folder=folder)
