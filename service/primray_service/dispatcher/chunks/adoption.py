"""Adoption of files that a worker leaves: each is validated and on the disk before any row names it."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from ...executor.base import Ended
from ...files import DataDirectory, adopt, adopt_copy, sync
from .messages import MadeFile

PREVIEW = "preview.raw"
LOG = "log.txt"
PREVIEW_BYTES = 32 * 2**20


class NotAdopted(Exception):
    """The files of a worker do not match its message."""


@dataclass(frozen=True)
class Adopted:
    name: str
    bytes: int
    sha256: str
    media_type: str


def checkpoint_file(number: int, frame: int, chunk_id: str) -> str:
    """Return a checkpoint's name in the job's folder, unique to the chunk, even against a server that wrongly believes it holds
    the lease."""
    return f"frames/{frame}/checkpoint-{number}-{chunk_id}.prc"


def part_file(first: int, number: int, frame: int, chunk_id: str) -> str:
    """Return a name like `checkpoint_file` for the part of a frame that begins with this sample."""
    return f"frames/{frame}/part-{first}-{number}-{chunk_id}.prc"


def missing(data: DataDirectory, folder: Path, names: Iterable[str]) -> set[str]:
    """Return those of these files, named by rows, that no longer exist."""
    return {name for name in names if not data.has(folder / name)}


def _why(error: ValueError | FileNotFoundError) -> str:
    """Return the reason without the file's name, which is the server's."""
    return (error.strerror or "the file is not there") if isinstance(error, OSError) else str(error)


def adopt_checkpoint(data: DataDirectory, source: Path, target: Path, most_bytes: int) -> int:
    try:
        size = adopt(source, target, most_bytes)
    except (ValueError, FileNotFoundError) as error:
        raise NotAdopted(_why(error)) from error
    data.share(target)
    return size


def adopt_preview(data: DataDirectory, source: Path, folder: Path) -> bool:
    """Adopt a preview; False if a newer one has replaced it, whose message follows."""
    try:
        adopt(source, folder / PREVIEW, PREVIEW_BYTES)
    except FileNotFoundError:
        return False
    except ValueError as error:
        raise NotAdopted(_why(error)) from error
    data.share(folder / PREVIEW)
    return True


def adopt_outputs(
    made: Iterable[MadeFile], ended: Ended, frame_folder: Path, most_bytes: int, chunk_id: str
) -> list[tuple[Adopted, Path]]:
    """Adopt a chunk's outputs under temporary names in the frame's folder, and validate them. `publish` gives them their
    names."""
    found, left = [], most_bytes
    take = adopt_copy if ended.lives else adopt
    for i, item in enumerate(made):
        kept = frame_folder / f"output-{i}-{chunk_id}"
        try:
            size = take(ended.folder / item.file, kept, left)
        except (ValueError, FileNotFoundError) as error:
            raise NotAdopted(_why(error)) from error
        left -= size
        with open(kept, "rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        if sha256 != item.sha256:
            raise NotAdopted(f"{item.name} does not have the reported digest")
        found.append((Adopted(item.name, size, sha256, item.media_type), kept))
    return found


def publish_new(data: DataDirectory, kept: Path, target: Path) -> bool:
    """Give an adopted file its name; False if a file of that name exists."""
    if data.objects is not None:
        data.objects.put(kept, data.name_of(target))  # if one exists, it has the same bytes
        kept.unlink()
        return True
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(kept, target)
    except FileExistsError:
        return False
    kept.unlink()
    return True


def publish_over(kept: Path, target: Path) -> None:
    os.replace(kept, target)


def published(data: DataDirectory, folder: Path) -> None:
    """Flush the folder's names to the disk."""
    if data.objects is None:
        sync(folder)


def tidy_frame(data: DataDirectory, job_id: str, number: int, keep: Collection[str]) -> None:
    """Remove the leftovers of dead chunks in a frame's folder: all but its checkpoints (`keep`, by their names in the job's
    folder), preview and log."""
    folder = data.frame(job_id, number)
    data.remove_below(folder, {folder / PREVIEW, folder / LOG} | {data.job(job_id) / name for name in keep if name})


def append_log(data: DataDirectory, path: Path, title: str, text: str | Path, most_bytes: int) -> None:
    """Append a run's log, given as text or as a file, to the frame's; beyond `most_bytes` the beginning is dropped."""
    data.bring_newest(path)
    _append(path, title, text, most_bytes)
    data.share(path)


def _append(path: Path, title: str, text: str | Path, most_bytes: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(text, Path):
        with open(text, "rb") as file:
            file.seek(max(os.fstat(file.fileno()).st_size - most_bytes, 0))
            text = file.read(most_bytes).decode(errors="replace")
    stamp = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    added = f"==== {stamp} {title}\n{text}{'' if not text or text.endswith(chr(10)) else chr(10)}".encode(errors="replace")
    earlier = path.read_bytes() if path.exists() else b""
    whole = earlier + added
    if len(whole) <= most_bytes:
        with open(path, "ab") as file:
            file.write(added)
        return
    note = b"[earlier lines are left out]\n"
    kept = whole[len(whole) - max(most_bytes - len(note), 0) :]
    beside = path.with_name("log.new")
    beside.write_bytes(note + kept[kept.find(b"\n") + 1 :])
    os.replace(beside, path)
