"""Downloads of a job's files, and uploads of packages by content.

A download goes to a temporary name beside the target; it is resumed after interruptions, checked, and renamed last.

An upload sends the list of a package's files first, then those that the server requests. A usdz is split at its larger members,
which it stores uncompressed: if a layer has changed, its textures are not sent again.
"""

from __future__ import annotations

import errno
import hashlib
import itertools
import os
import re
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from primray.images.output_path import through_links

from .documents import Json, Output, Scene, read
from .errors import ClientError, DigestMismatch, ServerUnreachable, UnexpectedAnswer
from .transport import Transport, json_of, object_of

PART = ".part"
Show = Callable[[int, int], None]  # arguments: bytes so far, bytes in total


def target_of(output: Output, folder: Path) -> Path:
    """Return the path of an output in a folder; UnexpectedAnswer if its name would lead out of the folder."""
    path = PurePosixPath(output.name)
    if path.is_absolute() or not path.parts or ".." in path.parts or "\\" in output.name or "\0" in output.name:
        raise UnexpectedAnswer(f"the server calls an output {output.name!r}, which is not a valid file name")
    return folder.joinpath(*path.parts)


def download(transport: Transport, job_id: str, output: Output, target: Path, show: Show, *, overwrite: bool = False) -> Path:
    """Download an output to `target`, unless a file with its digest is there already.

    Raises FileExistsError if another file is there, unless `overwrite`. A symbolic link is kept, and the file that it points to
    is written.
    """
    if _has(target, output):
        show(output.bytes, output.bytes)
        return target
    place = through_links(target)
    if place.exists() and not overwrite:
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    place.parent.mkdir(parents=True, exist_ok=True)
    # The digest in the name keeps two downloads of different pictures from continuing each other's bytes.
    part = place.with_name(f"{place.name}.{output.sha256[:16]}{PART}")
    for is_last in (False, True):
        _fetch(transport, job_id, output, part, show)
        if _has(part, output):
            os.replace(part, place)
            return target
        part.unlink()  # the partial file may have been damaged: start again, once
        if is_last:
            break
    raise DigestMismatch(f"{output.name} does not have the server's digest after the download")


def _has(path: Path, output: Output) -> bool:
    if not path.is_file() or path.stat().st_size != output.bytes:
        return False
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() == output.sha256


def _fetch(transport: Transport, job_id: str, output: Output, part: Path, show: Show) -> None:
    """Download until the partial file is complete; a broken connection is resumed, and every byte received resets the
    retries."""
    url = f"/v1/jobs/{quote(job_id, safe='')}/outputs/{quote(output.name, safe='')}"
    tries = 0
    while True:
        have = part.stat().st_size if part.exists() else 0
        if have > output.bytes:
            part.unlink()
            have = 0
        if have == output.bytes and part.exists():
            return
        try:
            _read_on(transport, url, output, part, have, show)
        except ClientError as error:
            now = part.stat().st_size if part.exists() else 0
            tries = 0 if now > have else tries + 1
            transport.patiently(max(0, tries - 1), error)


def _read_on(transport: Transport, url: str, output: Output, part: Path, have: int, show: Show) -> None:
    headers = {"Accept-Encoding": "identity"}
    if have:
        headers |= {"Range": f"bytes={have}-", "If-Range": f'"{output.sha256}"'}
    with transport.stream(url, headers, timeout_s=60.0) as answer:
        if answer.status_code == 416:
            part.unlink()
            return
        goes_on = answer.status_code == 206 and _starts_at(answer.headers.get("Content-Range", ""), have)
        if answer.status_code == 206 and not goes_on:
            raise UnexpectedAnswer(f"{output.name}: the server sent another range than requested")
        done = have if goes_on else 0
        with part.open("ab" if goes_on else "wb") as file:
            for data in answer.iter_raw():  # unbuffered: bytes waiting in a buffer would be lost when the connection breaks
                done += len(data)
                if done > output.bytes:
                    raise DigestMismatch(f"{output.name} is larger than the server's listed size")
                file.write(data)
                show(done, output.bytes)
        if done < output.bytes:
            raise ServerUnreachable(f"{output.name} broke off after {done} of {output.bytes} bytes")


def _starts_at(content_range: str, first: int) -> bool:
    match = re.fullmatch(r"bytes (\d+)-\d+/(?:\d+|\*)", content_range)
    return match is not None and int(match[1]) == first


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
