"""What a report says of the process."""

from __future__ import annotations

import subprocess
import sys

ASK = "from primray.report.report import peak_rss_bytes; print(peak_rss_bytes())"


def test_the_peak_is_not_that_of_the_process_that_started_it() -> None:
    """As getrusage(2) has it on Linux, across fork and exec."""
    large = f"import subprocess, sys; held = b'x' * 800_000_000; subprocess.run([sys.executable, '-c', {ASK!r}], check=True)"
    said = [
        int(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout)
        for code in (ASK, large)
    ]
    assert 2**20 < said[0] < 400_000_000
    assert said[1] < 1.2 * said[0]
