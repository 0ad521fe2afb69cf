"""The files that differ between two sides of a git repository, without the pages that earlier runs wrote into it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from .git import git

MARKER = "<!-- primray ci -->"  # begins a page's comment, by which both are found again
PAGE, REPORT, COMMENT = "index.html", "report.json", "comment.md"


@dataclass(frozen=True)
class Change:
    """A file that differs; paths are relative to the repository. `before` is None for a new file, `after` for a deleted one."""

    before: str | None
    after: str | None

    @property
    def name(self) -> str:
        if self.before is None:
            return f"{self.after} (new)"
        if self.after is None:
            return f"{self.before} (deleted)"
        return self.after if self.after == self.before else f"{self.before} -> {self.after}"

    @property
    def paths(self) -> set[str]:
        return {path for path in (self.before, self.after) if path is not None}


def changes(root: Path, between: Sequence[str], *, untracked: bool, index: Path | None = None) -> Iterator[Change]:
    """Yield what `git diff` says between two commits or trees, one and the working tree, or one and the index (--cached)."""
    asked = ("diff", "--name-status", "-z", "--find-renames", "--no-ext-diff", *between)
    words = iter(git(root, *asked, index=index).split("\0"))
    for status in words:
        if not status:
            break
        name = next(words)
        if status[0] in "RC":
            new = next(words)
            yield Change(name if status[0] == "R" else None, new)
        else:
            yield Change(None if status[0] == "A" else name, None if status[0] == "D" else name)
    if untracked:
        for name in git(root, "ls-files", "--others", "--exclude-standard", "-z").split("\0"):
            if name:
                yield Change(None, name)


def is_of_page(change: Change, before: Path, after: Path) -> bool:
    """Return whether a file is one that `primray ci -o` wrote: its folder's comment begins with the marker."""
    sides = ((change.before, before), (change.after, after))
    return all(_is_in_page(folder / path) for path, folder in sides if path is not None)


def _is_in_page(file: Path) -> bool:
    if file.name not in (PAGE, REPORT, COMMENT):
        return False
    try:
        with (file.parent / COMMENT).open("rb") as comment:
            return comment.read(len(MARKER)) == MARKER.encode()
    except OSError:
        return False
