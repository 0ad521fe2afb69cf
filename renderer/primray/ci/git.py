"""Calls of git; what it refuses is a SettingsError with code "git"."""

from __future__ import annotations

import subprocess
from pathlib import Path

from ..errors import SettingsError


def answers(folder: Path, *words: str) -> bool:
    return subprocess.run(["git", "-C", str(folder), *words], check=False, capture_output=True).returncode == 0


def git(folder: Path, *words: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(folder), *words], check=False, capture_output=True)
    except FileNotFoundError:
        raise SettingsError("primray ci needs git", code="git") from None
    if done.returncode != 0:
        raise SettingsError(f"git {words[0]}: {done.stderr.decode(errors='replace').strip()}", where=str(folder), code="git")
    return done.stdout.decode(errors="surrogateescape")
