"""Data sets on a Ray cluster: the bytes of processes, whatever is killed on the way."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.ray.cluster import RunningCluster
from tests.unit.dataset.room import plain_config, write_room

from primray.dataset import Config, RayWorkers, make
from primray.dataset.ledger import finished
from primray.errors import SettingsError

pytest.importorskip("yaml", reason="no PyYAML")

SAMPLES = 8
CHANGES: dict[str, Any] = {"samples": SAMPLES, "labels": {"classes": ["ball", "box", "can"]}, "write": ["yolo"]}


def write_config(folder: Path) -> Path:
    write_room(folder)
    path = folder / "set.yaml"
    path.write_text(json.dumps(plain_config(**CHANGES)))
    return path


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a data set. Names with a dot are none of it: workers of a lost node may write a while longer."""
    files = {p.relative_to(folder): p for p in sorted(folder.rglob("*")) if p.is_file()}
    return {str(name): p.read_bytes() for name, p in files.items() if not any(part.startswith(".") for part in name.parts)}


def command(config: Path, out: Path, cluster: RunningCluster) -> list[str]:
    run = [sys.executable, "-c", "from primray.cli import main; main()", "dataset"]
    return [*run, str(config), "-o", str(out), "--ray", cluster.address]


def wait_for(out: Path, count: int, process: subprocess.Popen[bytes]) -> None:
    while len(finished(out)) < count:
        assert process.poll() is None
        time.sleep(0.02)


def test_kills_of_the_command_and_of_a_node_change_no_byte(cluster: RunningCluster, tmp_path: Path) -> None:
    config, out = write_config(tmp_path), tmp_path / "by-ray"
    killed = subprocess.Popen(command(config, out, cluster))
    wait_for(out, 1, killed)
    killed.kill()
    killed.wait()
    again = subprocess.Popen(command(config, out, cluster))
    wait_for(out, 3, again)
    cluster.ask(do="kill-raylet", number=1)
    assert again.wait() == 0
    make(Config.read(config), tmp_path / "by-processes", processes=2)
    assert contents(out) == contents(tmp_path / "by-processes")


def test_a_sample_that_cannot_be_made_says_which(cluster: RunningCluster, tmp_path: Path) -> None:
    write_room(tmp_path)
    crowded = plain_config(samples=2)
    crowded["vary"]["props"]["gap"] = 50
    config = tmp_path / "crowded.yaml"
    config.write_text(json.dumps(crowded))
    # In a process of its own: one that has used Ray before keeps what it read of the environment then.
    run = subprocess.run(command(config, tmp_path / "out", cluster), capture_output=True, text=True)
    assert run.returncode != 0
    assert "dataset-crowded" in run.stderr
    assert "sample " in run.stderr


@pytest.mark.parametrize("address", ["127.0.0.1:9", "ray://127.0.0.1:9", "head"])
def test_a_cluster_that_is_not_there_is_named(tmp_path: Path, address: str) -> None:
    pytest.importorskip("ray", reason="skipped: no ray")
    write_room(tmp_path)
    with pytest.raises(SettingsError) as caught:
        make(Config.of(plain_config(), tmp_path), tmp_path / "out", executor=RayWorkers(address))
    assert caught.value.code == "ray-unreachable"
