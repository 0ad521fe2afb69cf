"""Uploads by content: the list of a package's files first, then those of them that the server asks for."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from .answers import json_of, object_of
from .documents import Json, Scene
from .download import Show
from .errors import UnexpectedAnswer
from .reading import read
from .transport import Transport

MOST_ROUNDS = 5  # files may be removed on the server, or change here, while others are sent
PART_BYTES = 2**20


def upload_files(transport: Transport, files: Mapping[str, Path], name: str, show: Show) -> Scene:
    sent = 0
    for _ in range(MOST_ROUNDS):
        places, asked = _listed(files, name)
        answer = object_of(json_of(transport.request("POST", "/v1/packages", body=asked, repeatable=True, timeout_s=300.0)))
        if "missing" not in answer:
            return read(Scene, answer)
        total = sent + int(answer["missing_bytes"])
        for sha256 in answer["missing"]:
            if sha256 not in places:
                raise UnexpectedAnswer("the server asks for a file that is not in the package")
            sent = _send(transport, sha256, places[sha256], sent, total, show)
    raise UnexpectedAnswer("the server asks for the same files again and again")


def _listed(files: Mapping[str, Path], name: str) -> tuple[dict[str, Path], Json]:
    """Where the bytes of each digest are, and the request."""
    places: dict[str, Path] = {}
    rows = []
    for path, file in sorted(files.items()):
        with file.open("rb") as opened:
            sha256 = hashlib.file_digest(opened, "sha256").hexdigest()
            size = opened.tell()
        places[sha256] = file
        rows.append({"path": path, "sha256": sha256, "bytes": size})
    return places, {"name": name, "files": rows}


def _send(transport: Transport, sha256: str, file: Path, before: int, total: int, show: Show) -> int:
    def parts() -> Iterator[bytes]:
        done = before
        with file.open("rb") as opened:
            while part := opened.read(PART_BYTES):
                done += len(part)
                yield part
                show(done, total)

    size = file.stat().st_size
    headers = {"Content-Type": "application/octet-stream", "Content-Length": str(size)}
    transport.request("PUT", f"/v1/contents/{sha256}", headers=headers, content=parts, repeatable=True, timeout_s=300.0)
    return before + size
