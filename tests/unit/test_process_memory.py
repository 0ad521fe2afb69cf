"""The memory that a process may use: the limits of its cgroups, and what the machine has."""

from __future__ import annotations

import os
from pathlib import Path

from primray.process_memory import _cgroup_limits, available_bytes


def test_limits_of_cgroups_are_found_up_to_the_root(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.write_text("9:name=systemd:/\n4:memory,cpu:/a/b\n0::/x/y\n")
    for folder, name, text in (
        ("memory/a", "memory.limit_in_bytes", "4000\n"),
        ("memory/a/b", "memory.limit_in_bytes", "9000\n"),
        ("x", "memory.max", "3000\n"),
        ("x/y", "memory.max", "max\n"),
    ):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / name).write_text(text)
    assert sorted(_cgroup_limits(tmp_path, own)) == [3000, 4000, 9000]
    assert list(_cgroup_limits(tmp_path, tmp_path / "none")) == []
    assert 0 < available_bytes() <= os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
