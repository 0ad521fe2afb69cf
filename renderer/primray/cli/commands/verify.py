"""`primray verify`: renders a pinned picture again, all of it or random tiles, and says what is proven."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..flags import in_order

if TYPE_CHECKING:
    from ...pinned.verification import Verification

NONE = "none"
SHARE = 0.01  # of wrong tiles, for which the chance to miss them is printed


@in_order()
def verify(
    lock: Annotated[str, typer.Argument(metavar="LOCK", help="The lock file.", show_default=False)],
    share: Annotated[
        float, typer.Option("--share", metavar="SHARE", help="Share of the picture to render again, of random tiles; 0: none.")
    ] = 1.0,
    ranges: Annotated[
        bool, typer.Option("--ranges", help="Render of each of these tiles a random range of its samples, not all of them.")
    ] = False,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="N", help="Seed of which tiles are chosen.", show_default="another each time"),
    ] = None,
    stage: Annotated[
        str | None, typer.Option("--stage", metavar="STAGE", help="The stage.", show_default="where the lock says")
    ] = None,
    picture: Annotated[
        str | None,
        typer.Option(
            "--picture", metavar="FILE", help="EXR to compare, of any machine; none: none.", show_default="where the lock says"
        ),
    ] = None,
    key: Annotated[
        str | None,
        typer.Option(
            "--key",
            metavar="FILE",
            help="Ed25519 public key (PEM) that must have signed the attestation.",
            show_default="no signature is asked for",
        ),
    ] = None,
    attestation: Annotated[
        str | None, typer.Option("--attestation", metavar="FILE", help="The attestation.", show_default="beside the lock")
    ] = None,
    threads: int | None = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-V", help="Print tracebacks of errors.")] = False,
) -> None:
    """Check that a pinned picture has the bits that its lock says, by rendering it again, or a random share of it.

    Exits with 1 where an input, a setting, a prim, the picture's file or a pixel is not as it was, and names the first.
    """
    from pathlib import Path

    from ...pinned.lock import Lock
    from ...pinned.verification import verify as verified
    from ..console import print_line, showing

    _use_class(Lock.read(Path(lock))[0].isa)
    with showing(lock, json) as progress:
        chosen: str | Literal[False] | None = False if picture == NONE else picture
        found = verified(
            lock,
            share=share,
            ranges=ranges,
            seed=seed,
            stage=stage,
            picture=chosen,
            key=key,
            attestation=attestation,
            threads=threads,
            progress=progress,
        )
    if json:
        print_line({"type": "verification", "lock": lock, **found.as_json()})
    else:
        print("\n".join(_lines(lock, found)))
        if key is not None and found.difference is None:
            print(f"its attestation is signed by {key}")
    if found.difference is not None:
        raise typer.Exit(1)


def _use_class(isa: str) -> None:
    """Use the core of the lock's ISA class, where this machine has it, as the bits of another may be others."""
    from ...core.native import runnable_isas

    if "PRIMRAY_ISA" not in os.environ and isa in runnable_isas() and find_spec(f"primray._core_{isa}") is not None:
        os.environ["PRIMRAY_ISA"] = isa


def _lines(lock: str, found: Verification) -> Iterator[str]:
    if found.difference is not None:
        yield f"{lock}: differs: {found.difference}"
        return
    if found.is_whole:
        yield f"{lock}: proven: all {found.pixels} pixels have the same bits, rendered again with all {found.samples} samples"
    elif found.tiles:
        yield (
            f"{lock}: proven: the same bits in {len(found.tiles)} of {found.of} tiles, rendered again with all their samples "
            f"({found.pixels} pixels)"
        )
        missed = found.chance_to_miss(SHARE)
        yield f"random tiles: were {SHARE:.0%} of them wrong, all of these would be right with a chance of {missed:.2g}"
    elif found.ranges:
        samples = sum(end - first for _, first, end in found.ranges)
        yield (
            f"{lock}: proven: the same bits of a range of samples in each of {len(found.ranges)} of {found.of} tiles, rendered "
            f"again alone ({samples / len(found.ranges):.4g} samples a pixel on average)"
        )
        yield "what is in no such range was not rendered, nor were the sums of all ranges"
    else:
        yield f"{lock}: the same inputs and settings; nothing was rendered"
    if found.file is not None:
        yield f"{found.file} has the bits of the lock in every pixel"
    yield from found.notes
