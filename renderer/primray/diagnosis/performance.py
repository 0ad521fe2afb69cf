"""Reasons why a render takes long: setting up, memory and rays, and the sources of its noise.

A pixel's part of the error is its squared standard error over (value^2 + 0.01), the weight of relMSE. The part of a light is
measured by rendering the scene with that light alone. Lights are independent but for this weight, so that their parts add up to
the whole's as far as choosing among them costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Doubles
from ..description import LightType, Mesh, NurbsPatch, SubdivisionMesh
from ..images.cryptomatte import FOG
from ..process_memory import machine_bytes
from ..report.picture_checks import weighed_errors
from ..sampling.error import ONE_PERCENT
from ..sampling.sampling import Sampling
from ..settings import Metric
from .examination import Examined, Finding, Question

LONG_SET_UP_S = 1.0  # least seconds of setting up that are reported
MOST = 0.5  # fraction of the set-up that a step must take to be reported
TEXELS_A_PIXEL = 16  # upper bound of what a view can use: finer levels are read in vain
LARGE_BYTES = 64 * 2**20
RAYS_A_SAMPLE = 15
MANY, TRIANGLES_A_PIXEL = 200_000, 8

READING = "read textures"


def find_slow(seen: Examined) -> Iterator[Finding]:
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
    if total < LONG_SET_UP_S or took[longest] < MOST * total:
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
    yield Finding(
        question=Question.SLOW, code="set-up", message=said, advice=advice[longest], prims=(), share=took[longest] / total
    )


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
    yield Finding(
        question=Question.SLOW,
        code="many-triangles",
        message=said,
        advice=advice,
        prims=tuple(path for _, path in largest),
        share=largest[0][0] / total,
    )


def _memory(seen: Examined) -> Iterator[Finding]:
    needs, has = seen.prepared.counts["process_bytes"], _memory_bytes()
    if has is not None and needs > 0.9 * has:
        said = f"The render needs about {_megabytes(needs)}; this machine has {_megabytes(has)}, and swaps beyond that."
        advice = "Use smaller textures, fewer triangles (--dicing-rate), or a machine with more memory."
        yield Finding(question=Question.SLOW, code="memory", message=said, advice=advice, prims=(), share=needs / has)


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


MOST_LIGHTS = 8
BUILDING_S = 4.0  # seconds to build all the scenes of one light each
HOT = 2.0  # ratio of a prim's fraction of the error to its fraction of the pixels
PART = 0.25  # least fraction of the error that is reported
NOISY = 1.2  # ratio of a volume's fraction of the error to that of the picture
BRIGHT, FEW_BOUNCES = 0.9, 4  # single-scattering albedo, scattering events
FEW_PIXELS = 0.001
FEW_HAVE = 0.5
LONG_RENDER_S = 60.0


def find_noise(seen: Examined) -> Iterator[Finding]:
    yield from _time(seen)
    part = error_parts(seen)
    if part is None or seen.pilot is None or seen.pilot.row.error.relmse.value <= ONE_PERCENT:
        return  # a picture this good has no noise to explain
    yield from _volumes(seen, part)
    yield from _hot_spots(seen, part)
    yield from _fireflies(part)
    yield from _lights(seen, part)


def time_to_error(seen: Examined, target: float = ONE_PERCENT) -> dict[str, Any] | None:
    """Return samples per pixel and seconds until relMSE is `target`, with 95 % intervals; None where they are unknown."""
    if seen.pilot is None or seen.pilot.metric is not Metric.RELMSE:
        return None
    return seen.pilot.predict(target).as_json()


def error_parts(seen: Examined) -> Doubles | None:
    """Return each pixel's fraction (H, W) of the picture's error, of sum 1; None where no error is known."""
    if seen.image.errors is None:
        return None
    values = weighed_errors(seen.image.pixels, seen.image.errors)
    total = float(values.sum())
    return values / total if total > 0 and math.isfinite(total) else None


def _time(seen: Examined) -> Iterator[Finding]:
    found = time_to_error(seen)
    if found is None:
        return
    if found["seconds"] is None:
        said = "An error of 1 % needs more samples than are allowed."
        yield Finding(Question.SLOW, "noise", said, "See which prims and lights cause it; --denoise may suffice.")
        return
    seconds = found["seconds"]["estimate"]
    if seconds > LONG_RENDER_S:
        said = f"An error of 1 % takes about {duration(seconds)} ({found['samples']['estimate']:,.0f} samples a pixel)."
        advice = "Use a larger --target-error, a smaller picture, more threads, or --denoise."
        yield Finding(Question.SLOW, "noise", said, advice)


def _hot_spots(seen: Examined, part: Doubles) -> Iterator[Finding]:
    numbers = seen.prims.ravel()
    errors = np.bincount(numbers, (part * (1 - sum(seen.volumes.values(), np.zeros(part.shape)))).ravel())
    pixels = np.bincount(numbers) / max(int(np.count_nonzero(numbers)), 1)  # fraction of the pixels on surfaces
    names, materials = seen.names("prim"), seen.names("material")
    for number in np.argsort(-errors)[:3].tolist():
        if number == 0 or errors[number] < max(PART, HOT * pixels[number]):
            continue
        on = seen.materials[seen.prims == number]
        material = materials.get(int(np.bincount(on).argmax()), "")
        said = f"{names[number]} has {errors[number]:.0%} of the error on {pixels[number]:.1%} of the visible surfaces"
        said += f" (material {material})" if material else ""
        advice = "Causes are rough glass, reflected small lights, or light found by chance: larger lights are less noisy."
        prims = (names[number], *([material] if material else []))
        yield Finding(
            question=Question.SLOW, code="hot-spot", message=f"{said}.", advice=advice, prims=prims, share=float(errors[number])
        )


def _volumes(seen: Examined, part: Doubles) -> Iterator[Finding]:
    """Yield the volume in which half of the error is, or a quarter that is more than its fraction of the picture.

    The error of a pixel is divided among what its samples hit first.
    """
    errors = {path: float((part * cover).sum()) for path, cover in seen.volumes.items()}
    worst = max(errors, key=lambda path: errors[path], default="")
    if not errors or errors[worst] < min(MOST, max(PART, NOISY * float(seen.volumes[worst].mean()))):
        return
    share = errors[worst]
    shown = float((seen.volumes[worst] > 0).mean())
    said = f"The volume {worst} has {share:.0%} of the error; it is seen in {shown:.1%} of the picture."
    yield Finding(
        question=Question.SLOW,
        code="noisy-volume",
        message=said,
        advice=_advice_on_volume(seen, worst),
        prims=() if worst == FOG else (worst,),
        share=share,
    )


def _advice_on_volume(seen: Examined, path: str) -> str:
    """Return what makes a volume less noisy, by what it is."""
    if any(emission.path == path for emission in seen.description.volume_emissions):
        return "It emits light: a smoother emission field is less noisy, and --denoise removes most of the noise."
    if path == FOG:
        return "Lights that are larger, or fewer, make shafts less noisy; a smaller density, or --denoise, too."
    albedo = max((max(medium.albedo) for medium in seen.description.media if medium.path == path), default=0.0)
    depth = seen.prepared.settings.max_depth
    if albedo > BRIGHT and (depth is None or depth > FEW_BOUNCES):
        return "Light scatters in it many times: a smaller --max-depth or scattering colour, or --denoise, is faster."
    return "Lights in or close to it should be larger; a smaller density, or --denoise, is faster."


def _fireflies(part: Doubles) -> Iterator[Finding]:
    few = max(1, round(FEW_PIXELS * part.size))
    share = float(np.partition(part.ravel(), -few)[-few:].sum())
    if share > FEW_HAVE and part.size >= 1000:
        said = f"{few:,} pixels ({FEW_PIXELS:.1%}) have {share:.0%} of the error: single samples that are very bright."
        advice = "Paths find light by chance: caustics of small lights, or emissive geometry that is no light. Enlarge it."
        yield Finding(question=Question.SLOW, code="fireflies", message=said, advice=advice, prims=(), share=share)


def error_of_lights(seen: Examined) -> Mapping[str, float] | None:
    """Return each light's fraction of the error, of sum 1 ("": emission that is no light); None where it is not measured."""
    lights = seen.description.lights
    builds = seen.costs.stages_s["build"] * (len(lights) + 1)
    if not 2 <= len(lights) <= MOST_LIGHTS or builds > BUILDING_S or seen.image.errors is None:
        return None
    found: dict[str, float] = {}
    for index, light in enumerate(lights):
        found[light.path] = found.get(light.path, 0.0) + _error_alone(seen, index)
    total = sum(found.values())
    return {path: value / total for path, value in found.items()} if total > 0 else None


def _error_alone(seen: Examined, index: int) -> float:
    """Return the error per sample with one light alone, weighed by the whole picture."""
    assert seen.steps.diced is not None
    dark = [
        light if k == index else replace(light, emission=(0.0, 0.0, 0.0)) for k, light in enumerate(seen.description.lights)
    ]
    description = replace(seen.steps.diced, lights=tuple(dark))
    textures = {file: list(images) for file, images in seen.steps.textures.items()}
    scene = seen.steps.build(description, textures, seen.prepared.settings, list(description.shapes))
    seconds = max(seen.sampling.seconds, 0.1) / len(dark)
    limited = replace(seen.prepared.settings, spp=16, target_error=None, adaptive=False, time_limit_s=seconds)
    sampling = Sampling.begin(scene, limited)
    sampling.run(None)
    pixels, errors = sampling.film.image()
    return float(weighed_errors(pixels, errors, seen.image.pixels).mean()) * sampling.film.samples / pixels[..., 0].size


def _lights(seen: Examined, part: Doubles) -> Iterator[Finding]:
    shares = error_of_lights(seen)
    if not shares:
        return
    worst = max(shares, key=lambda path: shares[path])
    if shares[worst] < max(PART, 1.2 / len(shares)):
        return
    light = next(light for light in seen.description.lights if light.path == worst)
    said = f"Of {len(shares)} lights, {worst} ({light.type.value}) causes {shares[worst]:.0%} of the error."
    advice = "Make it larger or weaker, restrict its links to what it should light, or check what is in front of it."
    if light.type is LightType.DOME:
        advice = "Portals (UsdLux PortalLight) mark where its light enters; a smoother texture is less noisy."
    yield Finding(question=Question.SLOW, code="noisy-light", message=said, advice=advice, prims=(worst,), share=shares[worst])


def duration(seconds: float) -> str:
    """Return a time in words."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
