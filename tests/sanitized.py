"""Tests that cannot run under the sanitizers of `make debug`."""

from __future__ import annotations

import os

import pytest

# The address sanitizer reserves terabytes of addresses, so limits of memory stop a process at once, and pages that are given
# back do not show.
limits_memory = pytest.mark.skipif(
    "libasan" in os.environ.get("LD_PRELOAD", ""), reason="skipped: the address sanitizer has its own use of memory"
)
