"""Uploads by content: first the list of a package's files, then those that the server requests.

A usdz is split at its larger members, which it stores uncompressed: if a layer has changed, its textures are not sent again.
"""

from __future__ import annotations

import hashlib
import itertools
import struct
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from .documents import Json, Scene
from .download import Show
from .errors import UnexpectedAnswer
from .reading import read
from .transport import Transport, json_of, object_of

MOST_ROUNDS = 5  # files may be removed on the server, or change here, during the upload
PART_BYTES = 2**20
CUT_FROM_BYTES = 2**20  # smallest usdz that is split
MEMBER_FROM_BYTES = 2**16  # smallest member that is worth its own request
MOST_PARTS = 2000


@dataclass(frozen=True)
class Stretch:
    """Range of bytes in a file."""

    file: Path
    begin: int
    size: int

    def read(self) -> Iterator[bytes]:
        left = self.size
        with self.file.open("rb") as opened:
            opened.seek(self.begin)
            while left and (part := opened.read(min(left, PART_BYTES))):
                left -= len(part)
                yield part

    def sha256(self) -> str:
        found = hashlib.sha256()
        for part in self.read():
            found.update(part)
        return found.hexdigest()


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
                raise UnexpectedAnswer("the server requests a file that is not in the package")
            sent = _send(transport, sha256, places[sha256], sent, total, show)
    raise UnexpectedAnswer("the server requests the same files again and again")


def _listed(files: Mapping[str, Path], name: str) -> tuple[dict[str, Stretch], Json]:
    """Return the location of each digest's bytes, and the request."""
    places: dict[str, Stretch] = {}
    rows: list[Json] = []
    for path, file in sorted(files.items()):
        whole = Stretch(file, 0, file.stat().st_size)
        row: Json = {"path": path, "sha256": whole.sha256(), "bytes": whole.size}
        cut = [(stretch.sha256(), stretch) for stretch in _members_of(whole)]
        if cut:
            row["parts"] = [{"sha256": sha256, "bytes": stretch.size} for sha256, stretch in cut]
        places |= dict(cut) or {row["sha256"]: whole}
        rows.append(row)
    return places, {"name": name, "files": rows}


def _members_of(whole: Stretch) -> list[Stretch]:
    """Return a usdz's larger members and the bytes between them; an empty list if the file is not worth splitting."""
    if whole.file.suffix.lower() != ".usdz" or whole.size < CUT_FROM_BYTES:
        return []
    cuts = {0, whole.size}
    try:
        with zipfile.ZipFile(whole.file) as package, whole.file.open("rb") as opened:
            for member in package.infolist():
                if member.file_size < MEMBER_FROM_BYTES or member.compress_type != zipfile.ZIP_STORED:
                    continue
                opened.seek(member.header_offset + 26)  # lengths of the name and the extra field: APPNOTE.TXT 4.3.7
                begin = member.header_offset + 30 + sum(struct.unpack("<HH", opened.read(4)))
                cuts |= {begin, begin + member.file_size}
    except (zipfile.BadZipFile, struct.error):
        return []  # the server reports the error
    places = sorted(cuts)
    stretches = [Stretch(whole.file, begin, end - begin) for begin, end in itertools.pairwise(places)]
    return stretches if 1 < len(stretches) <= MOST_PARTS and places[-1] == whole.size else []


def _send(transport: Transport, sha256: str, stretch: Stretch, before: int, total: int, show: Show) -> int:
    def parts() -> Iterator[bytes]:
        done = before
        for part in stretch.read():
            done += len(part)
            yield part
            show(done, total)

    headers = {"Content-Type": "application/octet-stream", "Content-Length": str(stretch.size)}
    transport.request("PUT", f"/v1/contents/{sha256}", headers=headers, content=parts, repeatable=True, timeout_s=300.0)
    return before + stretch.size
