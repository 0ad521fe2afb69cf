"""Downloads of a job's files: to a temporary name beside the target, resumed after interruptions, checked, and renamed last."""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from primray.images.output_path import through_links

from .documents import Output
from .errors import ClientError, DigestMismatch, ServerUnreachable, UnexpectedAnswer
from .transport import Transport

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
