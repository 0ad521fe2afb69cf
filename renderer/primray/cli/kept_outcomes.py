"""Outcomes of a contact sheet that are kept for the next one, by the content of all files that a stage is made of.

Beside an outcome are its files with the digests of their content: layers and textures of all variants, and those that are
missing. They are listed by a process of its own before the render, so that a stage that crashes USD is only a row of the sheet,
and a file that is saved during the render counts as changed. The next sheet only reads the files that are listed.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
import threading
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from ..content_hash import hash_of_file
from ..errors import PrimrayError
from ..images.image import replacing, write_text
from ..images.output_path import check_folder, make_folder
from .sheet_renders import Limits, Outcome, Render, render_stage, run_limited

_LIST_FILES = """
import json, resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
from primray.usd import files_to_watch
json.dump(sorted(files_to_watch(sys.argv[1])), open(sys.argv[2], "w"))
"""
_ENVIRONMENT = ("OCIO", "PXR_AR_DEFAULT_SEARCH_PATH", "PRIMRAY_ISA")  # variables that may change pictures
_MISSING = "missing"


class KeptOutcomes:
    """Outcomes in a folder. `found` counts those that did not have to be rendered again; `render` renders the others.

    `problem` is the error of the last outcome that could not be written: it is rendered again for the next sheet.
    """

    def __init__(self, folder: Path, render: Render = render_stage) -> None:
        self.found = 0
        self.problem: PrimrayError | None = None
        self._render = render
        self._folder = folder
        self._lock = threading.Lock()
        self._digests: dict[str, str] = {}  # of one sheet; textures are shared by many stages
        make_folder(folder / "outcome.json")
        check_folder(folder / "outcome.json")

    def render(self, folder: Path, stage: Path, limits: Limits, scratch: Path) -> Outcome:
        """Return the kept outcome of a stage, or render it and keep that."""
        name = hashlib.sha256(os.fsencode(os.path.abspath(stage))).hexdigest()[:32]
        record, picture = self._folder / f"{name}.json", self._folder / f"{name}.png"
        asked = _request(limits)
        kept = self._read(record, picture, asked)
        if kept is not None:
            with self._lock:
                self.found += 1
            return replace(kept, stage=stage.relative_to(folder).as_posix())
        scratch.mkdir(parents=True)
        files = _files_of(stage, limits, scratch)
        content = {file: self._digest(file) for file in files}
        outcome = self._render(folder, stage, limits, scratch)
        if files and isinstance(outcome.exit_code, int) and outcome.exit_code >= 0:  # others depend on the machine's load
            try:
                self._write(record, picture, outcome, {"asked": asked, "files": content})
            except PrimrayError as error:
                self.problem = error
        return outcome

    def _read(self, record: Path, picture: Path, asked: Any) -> Outcome | None:
        """Return the outcome if it was made of the same content; None too for a record that is damaged."""
        try:
            told = json.loads(record.read_text(encoding="utf-8"))
            if told["asked"] != asked or any(self._digest(file) != digest for file, digest in told["files"].items()):
                return None
            outcome = Outcome(**told["outcome"] | {"marks": tuple(told["outcome"]["marks"])})
            if told["picture"] != (self._digest(str(picture)) if told["picture"] else None):
                return None
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
        return replace(outcome, picture=str(picture) if told["picture"] else None)

    def _write(self, record: Path, picture: Path, outcome: Outcome, told: dict[str, Any]) -> None:
        digest = None
        if outcome.picture is not None:
            digest = hash_of_file(outcome.picture)
            with replacing(picture) as beside:
                shutil.copyfile(outcome.picture, beside)
        write_text(record, json.dumps(told | {"picture": digest, "outcome": asdict(outcome)}) + "\n")

    def _digest(self, file: str) -> str:
        with self._lock:
            if file in self._digests:
                return self._digests[file]
        try:
            digest = hash_of_file(file)
        except OSError:
            digest = _MISSING
        with self._lock:
            self._digests[file] = digest
        return digest


def _files_of(stage: Path, limits: Limits, scratch: Path) -> list[str]:
    """Return the files that a stage depends on; none if they cannot be listed, and then its outcome is not kept."""
    listed = scratch / "files.json"
    code = _LIST_FILES.format(limit=limits.memory_bytes)
    ended = run_limited([sys.executable, "-c", code, str(stage), str(listed)], limits.timeout_s, scratch / "files-err")
    return [] if ended.exit_code != 0 or not listed.exists() else list(json.loads(listed.read_text(encoding="utf-8")))


def _request(limits: Limits) -> dict[str, Any]:
    """Return what is asked of a render besides its files: settings, the content of files that flags name, versions."""
    from ..report.report import package_versions

    values = {name: value for name, value in asdict(limits).items() if name != "threads"}  # no pixel depends on threads
    named = {word: hash_of_file(word) for word in _paths_in(limits.flags)}
    environment = {name: os.environ.get(name) for name in _ENVIRONMENT}
    told = {"limits": values, "named": named, "environment": environment, "versions": package_versions()}
    return dict(json.loads(json.dumps(told)))


def _paths_in(flags: Iterable[str]) -> list[str]:
    words = [word.partition("=")[2] if word.startswith("--") and "=" in word else word for word in flags]
    return sorted({word for word in words if word and os.path.isfile(word)})
