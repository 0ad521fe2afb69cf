"""Reasons why a render takes long, before the first sample and in each: reading, dicing, building, memory, rays."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from ..description import Mesh, NurbsPatch, SubdivisionMesh
from ..process_memory import machine_bytes
from .examined import Examined
from .finding import Finding, Question

LONG_S = 1.0  # least seconds of setting up that are reported
MOST = 0.5  # fraction of the set-up that a step must take to be reported
TEXELS_A_PIXEL = 16  # upper bound of what a view can use: finer levels are read in vain
LARGE_BYTES = 64 * 2**20
RAYS_A_SAMPLE = 15
MANY, TRIANGLES_A_PIXEL = 200_000, 8

READING = "read textures"


def findings(seen: Examined) -> Iterator[Finding]:
    yield from _setting_up(seen)
    yield from _textures(seen)
    yield from _triangles(seen)
    yield from _memory(seen)
    yield from _rays(seen)


def set_up_seconds(seen: Examined) -> dict[str, float]:
    """Return the seconds of each stage; reading textures is separate from the rest of translation."""
    stages = seen.costs.stages_s
    reading = min(seen.steps.reading_s, stages["translate"])
    return {
        "open": stages["open"],
        "translate": stages["translate"] - reading,
        READING: reading,
        "dice": stages["dice"],
        "build": stages["build"],
    }


def _setting_up(seen: Examined) -> Iterator[Finding]:
    took = set_up_seconds(seen)
    total = sum(took.values())
    longest = max(took, key=lambda name: took[name])
    if total < LONG_S or took[longest] < MOST * total:
        return
    counts = seen.prepared.counts
    why: dict[str, Callable[[], str]] = {
        "open": lambda: f"{len(seen.stage['layers'])} layers are read and composed",
        "translate": lambda: f"{sum(seen.stage['prim_types'].values()):,} prims are translated",
        READING: lambda: f"{len(seen.steps.images)} images of {_megabytes(_image_bytes(seen))} are read",
        "dice": lambda: f"{_cages(seen):,} subdivision surfaces and patches become {counts['triangles_unique']:,} triangles",
        "build": lambda: f"{counts['triangles_unique']:,} triangles and {counts['instances']:,} instances get a hierarchy",
    }
    advice = {
        "open": "Leave out what is not seen (--mask, --load), or use fewer layers; usdc files read faster than usda.",
        "translate": "Instance what is repeated (instanceable = true, PointInstancer); merge meshes of few faces.",
        READING: "Make the largest ones smaller, or tiled and mipmapped (maketx): only what the view needs is kept.",
        "dice": "Use a larger --dicing-rate, or author subdivisionScheme none where the polygons are fine enough.",
        "build": "Instance what is repeated; keep a scene between renders (primray.Scene, primray view).",
    }
    said = f"Setting up takes {total:.1f} s, {longest} {took[longest]:.1f} s of it: {why[longest]()}."
    yield Finding(Question.SLOW, "set-up", said, advice[longest], (), took[longest] / total)


def _cages(seen: Examined) -> int:
    return sum(isinstance(shape, SubdivisionMesh | NurbsPatch) for shape in seen.description.shapes)


def _image_bytes(seen: Examined) -> int:
    return sum(image.values * image.channel_bytes for image in seen.steps.images)


def _textures(seen: Examined) -> Iterator[Finding]:
    width, height = seen.prepared.frame.size
    usable = TEXELS_A_PIXEL * width * height
    found: list[tuple[int, str]] = []
    for file, images in seen.steps.textures.items():
        for _, image in images:
            texels = image.shape[0] * image.shape[1]
            size = texels * image.shape[2] * image.stored.itemsize
            if texels > usable and size > LARGE_BYTES:
                found.append((size, f"{file.path} ({image.shape[1]} x {image.shape[0]}, {_megabytes(size)})"))
    found.sort(reverse=True)
    if found:
        s = "s have" if len(found) > 1 else " has"
        said = f"{len(found)} texture{s} more texels than {TEXELS_A_PIXEL} a pixel: {', '.join(t for _, t in found[:3])}"
        advice = "Make them smaller: a picture of this size cannot show more, and each is read and filtered whole."
        yield Finding(Question.SLOW, "large-textures", f"{said}.", advice)


def _triangles(seen: Examined) -> Iterator[Finding]:
    width, height = seen.prepared.frame.size
    assert seen.steps.diced is not None
    sizes = sorted(((len(s.triangles), s.path) for s in seen.steps.diced.shapes if isinstance(s, Mesh)), reverse=True)
    total = sum(size for size, _ in sizes)
    if total < MANY or total < TRIANGLES_A_PIXEL * width * height:
        return
    largest = sizes[:3]
    told = ", ".join(f"{path} {size / total:.0%}" for size, path in largest)
    said = f"{total:,} triangles are stored for {width * height:,} pixels, most of them in {told}."
    advice = "Use a larger --dicing-rate for surfaces that are diced, a coarser mesh, or instances."
    yield Finding(Question.SLOW, "many-triangles", said, advice, tuple(path for _, path in largest), largest[0][0] / total)


def _memory(seen: Examined) -> Iterator[Finding]:
    needs, has = seen.prepared.counts["process_bytes"], _memory_bytes()
    if has is not None and needs > 0.9 * has:
        said = f"The render needs about {_megabytes(needs)}; this machine has {_megabytes(has)}, and swaps beyond that."
        advice = "Use smaller textures, fewer triangles (--dicing-rate), or a machine with more memory."
        yield Finding(Question.SLOW, "memory", said, advice, (), needs / has)


def _rays(seen: Examined) -> Iterator[Finding]:
    film = seen.sampling.film
    per_sample = film.rays / max(film.samples, 1)
    if per_sample > RAYS_A_SAMPLE:
        kinds = sorted(film.rays_by_kind.items(), key=lambda item: -item[1])
        told = ", ".join(f"{count / film.rays:.0%} {kind}" for kind, count in kinds[:3] if count)
        said = f"A sample takes {per_sample:.0f} rays ({told}): long paths, through glass, interiors or between bright walls."
        advice = "A smaller --max-depth is faster and darker; thin walls (thin_walled, opacity) need fewer rays than solids."
        yield Finding(Question.SLOW, "long-paths", said, advice)


def speed(seen: Examined) -> dict[str, Any]:
    """Return the rates at which samples were taken."""
    film, seconds = seen.sampling.film, max(seen.sampling.seconds, 1e-9)
    return {
        "rays_per_s": film.rays / seconds,
        "samples_per_s": film.samples / seconds,
        "rays_per_sample": film.rays / max(film.samples, 1),
        "rays_by_kind": film.rays_by_kind,
        "threads": seen.prepared.settings.threads,
    }


def _memory_bytes() -> int | None:
    try:
        return machine_bytes()
    except (OSError, ValueError):
        return None


def _megabytes(count: int) -> str:
    return f"{count / 2**20:,.0f} MiB"
