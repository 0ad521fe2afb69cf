"""What is kept of a worker's log."""

from __future__ import annotations

from pathlib import Path

from primray_service.dispatcher.chunks.adoption import append_log
from primray_service.files import DataDirectory


def test_a_log_keeps_its_newest_part(tmp_path: Path) -> None:
    data, path = DataDirectory(tmp_path), tmp_path / "log.txt"
    for i in range(100):
        append_log(data, path, f"run {i}", "a line\n" * 20, 2000)
        assert path.stat().st_size <= 2000
    text = path.read_text()
    assert text.startswith("[earlier lines are left out]\n")
    assert "run 99" in text
    assert "run 50" not in text
