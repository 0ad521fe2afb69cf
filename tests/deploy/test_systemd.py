"""deploy/systemd: as systemd itself reads the unit, and what it says of flags, walls and the time to stop."""

from __future__ import annotations

import shutil
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest

from primray_service.server import SHUTDOWN_S

from .flags import check_serve_flags, flags_of
from .manifests import ROOT

FILE = ROOT / "deploy/systemd/primray.service"
PROGRAM = "/opt/primray/bin/primray"


def unit() -> ConfigParser:
    found = ConfigParser(interpolation=None, delimiters=["="], comment_prefixes=["#"])
    found.optionxform = str  # type: ignore[assignment,method-assign]
    found.read_string(FILE.read_text())
    return found


def complaints(text: str, folder: Path) -> str:
    """What systemd-analyze finds wrong, with a program that this machine has."""
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("skipped: no systemd-analyze")
    file = folder / FILE.name
    # By a link: systemd splits a path at its spaces.
    here = folder / "program"
    here.symlink_to(sys.executable)
    file.write_text(text.replace(PROGRAM, str(here)))
    done = subprocess.run([program, "verify", str(file)], capture_output=True, text=True, timeout=60)
    ours = [line for line in (done.stdout + done.stderr).splitlines() if FILE.name in line]
    assert ours or done.returncode == 0, done.stderr
    return "\n".join(ours)


def test_systemd_takes_it(tmp_path: Path) -> None:
    assert complaints(FILE.read_text(), tmp_path) == ""


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("OOMPolicy=continue", "OOMPolicy=go-on"), ("PrivateTmp=", "PrivatTmp="), (PROGRAM, "/opt/nowhere/primray")],
)
def test_what_is_wrong_is_found(tmp_path: Path, right: str, wrong: str) -> None:
    assert right in FILE.read_text()
    assert complaints(FILE.read_text().replace(right, wrong), tmp_path) != ""


def test_the_command_is_ours_and_safe() -> None:
    service = unit()["Service"]
    program, command, *words = service["ExecStart"].split()
    assert [program, command, words.pop()] == [PROGRAM, "serve", "$PRIMRAY_ARGUMENTS"]
    check_serve_flags(words)
    flags = flags_of(words)
    # A proxy on the same machine reaches loopback for everybody.
    assert "--require-keys" in flags
    assert flags["--host"] == "127.0.0.1"
    assert flags["--data"] == "${STATE_DIRECTORY}"


def test_it_stops_after_the_server_has() -> None:
    service = unit()["Service"]
    assert service["KillMode"] == "mixed"
    assert int(service["TimeoutStopSec"]) >= 2 * SHUTDOWN_S


def test_the_workers_sandbox_is_left_what_it_needs() -> None:
    """User namespaces, a host name of its own, and a /proc that nothing is mounted over: else bubblewrap is refused."""
    service = unit()["Service"]
    assert service["NoNewPrivileges"] == "yes"
    over_proc = {"ProtectKernelTunables", "ProtectKernelLogs", "ProtectProc", "ProcSubset"}
    assert not {"RestrictNamespaces", "SystemCallFilter", "ProtectHostname", "PrivateUsers", *over_proc} & set(service)
    assert {"AF_UNIX", "AF_INET", "AF_INET6", "AF_NETLINK"} == set(service["RestrictAddressFamilies"].split())
