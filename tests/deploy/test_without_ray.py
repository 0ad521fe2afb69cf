"""deploy/kubernetes/without-ray: a server with its workers in one pod, and frames as a Job, beside the folder above."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

from .flags import check_serve_flags, flags_of
from .manifests import FOLDER, NAMESPACE, ROOT, of_kind, one

HERE = FOLDER / "without-ray"
FILES = sorted(HERE.glob("*.yaml"))
DOCUMENTS: dict[str, dict[str, Any]] = {
    document["kind"]: document for file in FILES for document in yaml.safe_load_all(file.read_text())
}
TEMPLATES = {kind: DOCUMENTS[kind]["spec"]["template"] for kind in ("Deployment", "Job")}
GiB = 2**30


def container(kind: str) -> dict[str, Any]:
    (found,) = TEMPLATES[kind]["spec"]["containers"]
    return dict(found)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_kubernetes_takes_it(file: Path) -> None:
    validator = pytest.importorskip("kubernetes_validate")
    for document in yaml.safe_load_all(file.read_text()):
        validator.validate(document, validator.latest_version(), strict=True)
        with pytest.raises(validator.ValidationError):
            validator.validate({**document, "spec": {**document["spec"], "wrong": 1}}, validator.latest_version(), strict=True)
        assert document["metadata"]["namespace"] == NAMESPACE


@pytest.mark.parametrize("kind", TEMPLATES)
def test_a_pod_may_do_what_the_others_may(kind: str) -> None:
    """As strict as the server of the folder above, which the tests of that hold."""
    above = of_kind("Deployment")[0]["spec"]["template"]["spec"]
    pod, inside = TEMPLATES[kind]["spec"], container(kind)
    assert pod["securityContext"] == above["securityContext"]
    assert inside["securityContext"] == above["containers"][0]["securityContext"]
    assert pod["automountServiceAccountToken"] is False
    volumes = {volume["name"] for volume in pod["volumes"]}
    assert {mount["name"] for mount in inside["volumeMounts"]} == volumes
    assert "/tmp" in {mount["mountPath"] for mount in inside["volumeMounts"]}
    assert inside["resources"]["limits"]["memory"] == inside["resources"]["requests"]["memory"]


def test_the_server_is_the_one_that_the_policies_and_the_service_mean() -> None:
    above = one("Deployment")
    assert TEMPLATES["Deployment"]["metadata"]["labels"] == above["spec"]["template"]["metadata"]["labels"]
    assert DOCUMENTS["Deployment"]["metadata"]["name"] == above["metadata"]["name"]
    assert DOCUMENTS["Service"] == next(each for each in of_kind("Service") if each["metadata"]["name"] == "server")
    assert DOCUMENTS["PersistentVolumeClaim"] == next(
        each for each in of_kind("PersistentVolumeClaim") if each["metadata"]["name"] == "server-data"
    )
    before = {each["name"]: each for each in above["spec"]["template"]["spec"]["containers"][0]["env"]}
    assert container("Deployment")["env"] == [before["PRIMRAY_DB_PASSWORD"], before["PRIMRAY_DATABASE"]]


def test_its_workers_fit_into_its_pod() -> None:
    inside = container("Deployment")
    check_serve_flags(inside["args"][1:])
    flags = flags_of(inside["args"][1:])
    assert "--executor" not in flags
    limits = inside["resources"]["limits"]
    assert flags["--cores"] == limits["cpu"]
    each = int(flags["--limit"].removeprefix("memory_bytes=").removesuffix("G"))
    # The server, the check of a scene and workers that wait have the rest.
    assert int(flags["--slots"]) * each + 4 <= int(limits["memory"].removesuffix("Gi"))


def test_a_job_gives_up_on_what_fails_in_every_frame() -> None:
    from primray_service.cli.exits import SCENE_REJECTED, USAGE

    spec = DOCUMENTS["Job"]["spec"]
    (fail,) = [rule for rule in spec["podFailurePolicy"]["rules"] if rule["action"] == "FailJob"]
    assert fail["onExitCodes"]["values"] == [USAGE, SCENE_REJECTED]
    assert fail["onExitCodes"]["containerName"] == container("Job")["name"]
    assert spec["completionMode"] == "Indexed"
    assert spec["template"]["spec"]["restartPolicy"] == "Never"


def test_the_jobs_command_renders_the_frame_of_its_index(tmp_path: Path) -> None:
    """The command itself, with paths and the target of a test."""
    inside = container("Job")
    scene = sorted((ROOT / "scenes/analytic").rglob("*.usda"))[0]
    (text,) = inside["args"]
    for name, value in (
        ("/stages/shot.usda", shlex.quote(str(scene))),
        ("/pictures/", f"{tmp_path}/"),
        ("--target-error 0.001", "--spp 1 --res 16 12"),
    ):
        assert text.count(name) == 1, name
        text = text.replace(name, value)
    first = next(each["value"] for each in inside["env"] if each["name"] == "FIRST")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "FIRST": first, "JOB_COMPLETION_INDEX": "3"}
    done = subprocess.run([*inside["command"], text], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert [file.name for file in tmp_path.glob("*.exr")] == ["shot.1004.exr"]


def test_the_image_is_the_dockerfiles() -> None:
    images = {container(kind)["image"] for kind in TEMPLATES}
    assert images == {"registry.example/primray:latest"}
    assert f"docker build -t {images.pop()} ." in (ROOT / "docs/service/scaling.md").read_text()
    assert re.search(r'^ENTRYPOINT \["primray"\]$', (ROOT / "Dockerfile").read_text(), re.MULTILINE)
