"""A worker of a data set: renders samples into its folder, with a scene that stays ready from one to the next.

The program, `python -m primray.dataset.worker`, reads JSON lines from stdin: the order, then the index of one sample after the
other. It answers each with a line: the sample's record, without its things, or the error. When stdin ends, so does it.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from ..errors import LimitError, PrimrayError, SceneError, SettingsError
from .config import Config
from .sampler import Sampler

PROGRAM = "primray.dataset.worker"
_BY_EXIT_CODE = {error.exit_code: error for error in (SceneError, SettingsError, LimitError)}


def order_of(config: Config, folder: Path, threads: int | None, classes: str) -> dict[str, Any]:
    """Return what a worker has to know, as JSON has it."""
    return {
        "text": config.text,
        "plain": None if config.text else config.plain,
        "name": config.name,
        "inputs": str(config.folder),
        "folder": str(folder.absolute()),
        "threads": threads,
        "classes": classes,
    }


class Worker:
    """Renders samples of an order; use it as a context manager."""

    def __init__(self, order: Mapping[str, Any]) -> None:
        if order["text"]:
            config = Config.parse(order["text"], order["inputs"], order["name"])
        else:
            config = Config.of(order["plain"], order["inputs"])
        self._folder = Path(order["folder"])
        self._scratch = tempfile.TemporaryDirectory(prefix="primray-dataset-")
        self._sampler = Sampler(config, threads=order["threads"], scratch=Path(self._scratch.name), classes=order["classes"])

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self._sampler.close()
        self._scratch.cleanup()

    def make(self, index: int) -> dict[str, Any]:
        """Make a sample, and return what the order's giver needs of its record; or the error, as JSON has it."""
        try:
            record = self._sampler.make(index, self._folder)
        except PrimrayError as error:
            where = f"sample {index}: {error.where}" if error.where else f"sample {index}"
            return {"index": index, "error": [error.exit_code, error.code, error.message, where]}
        return {"index": index, "diagnostics": record["diagnostics"]}


def error_of(answer: Mapping[str, Any]) -> PrimrayError:
    """Return the error of a worker's answer as an exception."""
    exit_code, code, message, where = answer["error"]
    return _BY_EXIT_CODE.get(exit_code, PrimrayError)(message, where=where, code=code)


def main(orders: TextIO, answers: TextIO) -> None:
    order = json.loads(orders.readline())
    try:
        worker = Worker(order)
    except PrimrayError as error:
        print(json.dumps({"error": [error.exit_code, error.code, error.message, error.where]}), file=answers, flush=True)
        return
    with worker:
        for line in orders:
            print(json.dumps(worker.make(int(line))), file=answers, flush=True)


if __name__ == "__main__":
    out = os.fdopen(os.dup(1), "w")  # what libraries print goes to stderr
    os.dup2(2, 1)
    try:
        main(sys.stdin, out)
    except BrokenPipeError:  # whoever gave the order is gone
        os._exit(1)
