"""Log of the samples of one pixel, for finding out where an outlier comes from: `primray render --debug-pixel`, `debug_pixel`.

The core renders the samples of the pixel once more, one path at a time, and records what happens at each vertex.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..errors import SettingsError
from ..render.render import with_setting_names
from ..settings import DEFAULT_SPP, RenderSettings, with_values

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..settings.written import SettingsValues


Event = dict[str, Any]

NAMING_AOVS = ("prim", "instance", "material")  # they make the core's scene keep the names of its rows
FLAGS = ("front", "delta", "transmits", "straight", "enters", "survives")
PROBABILITIES = ("presence", "diffuse", "behind", "fuzz", "specular", "coat", "transmission", "subsurface")
RADIANCES = ("radiance", "contribution", "unshadowed", "value", "clamped", "caustics")


@dataclass(frozen=True)
class PixelLog:
    """The samples of one pixel, each with the events of its paths in the order in which they happened.

    >>> log = primray.debug_pixel("shot.usda", 16, 9, resolution=(32, 18), spp=4)
    >>> len(log.samples), log.samples[0]["events"][0]["kind"]
    (4, 'camera')
    """

    scene: str
    pixel: tuple[int, int]  # from the left and from the top of the frame
    camera: str
    splits: tuple[int, int]  # paths from the first surface that is neither mirror nor smooth glass, and light samples there
    value: tuple[float, float, float]  # of the pixel, as in the picture before post-processing
    alpha: float
    samples: tuple[Mapping[str, Any], ...]

    def as_json(self) -> dict[str, Any]:
        """Return what `primray render SCENE --debug-pixel X Y --json` prints."""
        return {
            "type": "pixel",
            "scene": self.scene,
            "pixel": list(self.pixel),
            "camera": self.camera,
            "splits": {"paths": self.splits[0], "light_samples": self.splits[1]},
            "value": list(self.value),
            "alpha": self.alpha,
            "samples": list(self.samples),
        }

    def lines(self) -> list[str]:
        """Return the log as text: the brightest sample first, since it is the one that outliers come from."""

        return lines(self)


@with_setting_names
def debug_pixel(
    stage: str | os.PathLike[str] | Any,
    x: int,
    y: int,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    **values: Unpack[SettingsValues],
) -> PixelLog:
    """Return what happens to the samples of the pixel in column `x` and row `y` of the frame, both from 0, from the top left.

    >>> log = primray.debug_pixel("shot.usda", 16, 9, resolution=(32, 18), spp=4)
    >>> log.pixel, [event["kind"] for event in log.samples[0]["events"]][:2]
    ((16, 9), ['camera', 'hit'])

    The samples are those that `render` takes of it with the same settings. A target error or a time limit does not end them:
    `spp`, or 64, does. Fields of RenderSettings may be given by name. Errors are those of `render`.
    """
    settings = with_values(settings, values)
    from .. import core, usd
    from ..diagnostics import Diagnostics
    from ..render.prepare import open_once, prepare
    from ..report.report import Costs

    opened = open_once(stage, settings)
    named = _named(settings)
    prepared = prepare(opened.stage, opened.diagnostics, named, Costs(), Diagnostics())
    settings, scene = prepared.settings, prepared.scene
    width, height = prepared.frame.size
    if not (0 <= x < width and 0 <= y < height):
        raise SettingsError(
            f"the frame has {width} x {height} pixels, and none at {x} {y}", where="debug_pixel", code="debug-pixel"
        )
    splits = core.choose_splits(scene, settings)
    first, end = (core.samples_of_replicates(number) for number in _samples_of(settings))
    spans = tuple(zip(first, end, strict=True))
    events = core.log_pixel(scene, x, y, spans, splits, settings)
    samples = tuple(_by_sample(_named_events(scene, events, splits)))
    name = os.fspath(stage) if isinstance(stage, str | os.PathLike) else usd.stage_name(opened.stage)
    valid = [sample for sample in samples if all(np.isfinite(sample["value"]))]
    mean = np.mean([[*sample["value"], sample["alpha"]] for sample in valid], axis=0) if valid else np.zeros(4)
    color = (float(mean[0]), float(mean[1]), float(mean[2]))
    return PixelLog(name, (x, y), prepared.camera.path, (splits.paths, splits.lights), color, float(mean[3]), samples)


def _named(settings: RenderSettings) -> RenderSettings:
    """Return the settings with the AOVs that name what is hit."""
    return replace(settings, aovs=tuple(dict.fromkeys((*(settings.aovs or ()), *NAMING_AOVS))))


def _samples_of(settings: RenderSettings) -> tuple[int, int]:
    """Return the range of samples [first, end) per pixel."""
    if settings.sample_range is not None:
        return settings.sample_range
    return 0, DEFAULT_SPP if settings.spp is None else settings.spp


def _named_events(scene: CoreScene, events: Sequence[Event], splits: tuple[int, int]) -> list[Event]:
    """Return the events with prim paths in place of the core's numbers, truth values, and radiance as the picture has it."""
    from ..core.passes import ASIDE

    names = _Names(scene, events)
    numbers: dict[int, int] = {}
    named = []
    for event in events:
        kept = {name: value for name, value in event.items() if name not in names.numbers}
        for name in RADIANCES:
            if name in kept:
                kept[name] = [scene.exposure_scale * part for part in kept[name]]
        for name in FLAGS:
            if name in kept:
                kept[name] = kept[name] > 0
        if event["kind"] == "camera":
            numbers[event["sample"]] = event["part"]
        part = _part(event, numbers.get(event["sample"], 0), splits)
        del kept["part"]
        aside = {"aside": True} if event["part"] & ASIDE else {}
        named.append(kept | names.of(event) | aside | ({} if part is None else {"part": part}))
    return named


def _part(event: Event, number: int, splits: tuple[int, int]) -> int | None:
    """Return which part of a split sample, or of several light samples, an event belongs to; None: it is not split."""
    parts = splits[1] if event["kind"] == "light sample" and event["vertex"] == 0 else splits[0]
    part = event["part"] - number * parts
    return part if parts > 1 and 0 <= part < parts and (event["part"] != number or event["vertex"] > 0) else None


class _Names:
    """Prim paths by the core's numbers of shapes, instances, materials and lights."""

    numbers = ("shape", "surface", "instance", "outer", "light", "dome")

    def __init__(self, scene: CoreScene, events: Sequence[Event]) -> None:
        from ..images.first_hit import Ids

        assert scene.uploaded is not None
        self._lights, self._domes = dict(scene.uploaded.light_paths), scene.uploaded.dome_paths
        shapes = {(int(e["shape"]), int(e["surface"]), int(e["instance"]), int(e["outer"])) for e in events if "shape" in e}
        emitters: dict[int, tuple[int, int]] = {}
        for event in events:
            light = int(event.get("light", -1))
            if light >= 0 and light not in self._lights:
                emitters[light] = scene.shape_of_light(light)
        rows = [*shapes, *((shape, -1, instance, -1) for shape, instance in emitters.values())]
        assert scene.record is not None
        ids = Ids(scene, scene.record, scene.record.names)
        table = np.array(rows, np.int32).reshape(-1, 4)
        planes = {name: table[:, [k]] for k, name in enumerate(("prim", "material", "instance", "outer"))}
        found = [ids.prim(planes), ids.material(planes), ids.instance(planes)]
        texts = [[names.get(int(number), "") for number in numbers[:, 0]] for numbers, names in found]
        self._rows = {row: (texts[0][i], texts[1][i], texts[2][i]) for i, row in enumerate(rows)}
        for light, (shape, instance) in emitters.items():
            prim, _, placed = self._rows[shape, -1, instance, -1]
            self._lights[light] = f"{prim} in {placed}" if placed else prim

    def of(self, event: Event) -> Event:
        found: Event = {}
        if "shape" in event:
            row = int(event["shape"]), int(event["surface"]), int(event["instance"]), int(event["outer"])
            prim, material, instance = self._rows[row]
            found |= {"prim": prim, "material": material} | ({"instance": instance} if instance else {})
        if event.get("light", -1) >= 0:
            found["light"] = self._lights[int(event["light"])]
        if "dome" in event:
            found["light"] = self._domes[int(event["dome"])]
        return found


def _by_sample(events: Sequence[Event]) -> Iterator[Event]:
    """Yield one mapping for each sample: its value and its own events; paths of different samples alternate in `events`."""
    own: dict[int, list[Event]] = {}
    for event in events:
        own.setdefault(event.pop("sample"), []).append(event)
    for number, found in sorted(own.items()):
        last = found.pop()
        assert last["kind"] == "sample"
        camera = next(event for event in found if event["kind"] == "camera")
        facts = {name: last[name] for name in last if name not in ("kind", "vertex", "depth")}
        place = {"number": number, "replicate": int(camera.pop("replicate")), "index": int(camera.pop("index"))}
        yield place | facts | {"events": found}


def lines(log: PixelLog) -> list[str]:
    """Return the pixel's value and what each sample adds to it, then the events of each sample, the brightest first."""
    x, y = log.pixel
    samples = sorted(log.samples, key=_brightness, reverse=True)
    text = [f"{log.scene}, pixel {x} {y} of {log.camera or 'the automatic camera'}: {_color(log.value)}, alpha {log.alpha:.4g}"]
    text += [_spread(samples)]
    if max(log.splits) > 1:
        text += [f"From the first surface {log.splits[0]} paths continue, and {log.splits[1]} light samples are taken there."]
    for sample in samples:
        text += ["", *_sample(sample, len(samples))]
    return text


def _brightness(sample: Mapping[str, Any]) -> float:
    value = max(sample["value"])
    return float("inf") if np.isnan(value) else float(value)


def _spread(samples: Sequence[Mapping[str, Any]]) -> str:
    values = [_brightness(sample) for sample in samples]
    total = sum(values)
    share = f", {100 * values[0] / total:.3g} % of the pixel" if 0 < total < float("inf") else ""
    return (
        f"{len(samples)} samples; the largest channel of the brightest is {values[0]:.4g}{share}, that of the median "
        f"{float(np.median(values)):.4g}."
    )


def _sample(sample: Mapping[str, Any], count: int) -> Iterable[str]:
    yield f"sample {sample['number']} (replicate {sample['replicate']}, index {sample['index']}): {_color(sample['value'])}"
    for name, meaning in (
        ("lens_weight", "times the lens's weight"),
        ("clamped", "clamped away"),
        ("caustics", "caustics left out"),
    ):
        if name in sample and sample[name] != [0, 0, 0]:
            yield f"  {meaning}: {_color(sample[name])}"
    before: tuple[object, ...] | None = None
    for event in sample["events"]:
        place = event["vertex"], event.get("part"), "aside" in event
        heading = f"vertex {event['vertex']}" + (", aside" if "aside" in event else "")
        heading += "" if "part" not in event else f", part {event['part']}"
        text = _TEXTS[event["kind"]](event)
        yield f"  {'' if place == before else heading:<17} {event['kind']:<13} {text}{_contribution(event)}"
        before = place


def _contribution(event: Mapping[str, Any]) -> str:
    return f"   ADDS {_color(event['contribution'])}" if "contribution" in event else ""


def _color(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"


def _camera(event: Mapping[str, Any]) -> str:
    moves = f", time {event['time']:.4g}" if event["time"] else ""
    return f"from {_color(event['origin'])} along {_color(event['direction'])}{moves}"


def _hit(event: Mapping[str, Any]) -> str:
    instance = f" in {event['instance']}" if "instance" in event else ""
    material = f" ({event['material']})" if event["material"] else ""
    side = "front" if event["front"] else "back"
    return (
        f"{event['prim']}{instance}{material}, its {side}, at distance {event['distance']:.5g}, point "
        f"{_color(event['position'])}, normal {_color(event['shading_normal'])}, throughput {_color(event['throughput'])}"
    )


def _lobes(event: Mapping[str, Any]) -> str:
    shares = [
        f"{name} {event[name]:.3g}"
        for name in PROBABILITIES
        if event.get(name, 0) > 0 and (name, event[name]) != ("presence", 1)
    ]
    rest = [f"{name} {_value(event[name])}" for name in ("alpha", "albedo", "mean_cosine", "droplet_diameter") if name in event]
    return f"{event['why']}: {', '.join([*shares, *rest])}"


def _value(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else _color(value)


def _light_sample(event: Mapping[str, Any]) -> str:
    light = event.get("light", "")
    if "unshadowed" not in event:
        return f"{light}: {event['why']}" if light else event["why"]
    if event.get("why"):
        fate = event["why"]
    elif event["visible"] == (1, 1, 1):
        fate = "visible"
    else:
        fate = "blocked" if max(event["visible"]) == 0 else f"{_color(event['visible'])} of it passes"
    choice, densities = event["choice_probability"], f"{event['light_pdf']:.4g} beside the BSDF's {event['bsdf_pdf']:.4g}"
    return (
        f"{light} (chosen with {choice:.3g}) at {event['distance']:.4g}, radiance {_color(event['radiance'])}, "
        f"f cos {_color(event['f_cos'])}, density {densities}: weight {event['weight']:.3g}, {fate}"
    )


def _emission(event: Mapping[str, Any]) -> str:
    weight = f", weight {event['weight']:.3g}" if "weight" in event else ""
    light = f", density {event['light_pdf']:.4g} of light samples" if "light_pdf" in event else ""
    found = f", density {event['bsdf_pdf']:.4g} of the ray" if event["bsdf_pdf"] > 0 else ""
    return f"{event.get('light', 'the surface')} shows {_color(event['radiance'])}{found}{light}{weight}"


def _scatter(event: Mapping[str, Any]) -> str:
    direction, throughput = _color(event["direction"]), _color(event["throughput"])
    if "weight" not in event:
        return f"{event['why']}, along {direction}, throughput {throughput}"
    kinds = [name for name in ("straight", "enters") if event[name]]
    how = " ".join(["transmitted" if event["transmits"] else "reflected", *kinds])
    density = "a delta lobe" if event["delta"] else f"density {event['pdf']:.4g}, f cos {_color(event['f_cos'])}"
    return f"{how} along {direction}, {density}, weight {_color(event['weight'])}, throughput {throughput}"


def _roulette(event: Mapping[str, Any]) -> str:
    fate = "survives" if event["survives"] else "ends"
    return f"{fate} (probability {event['survival']:.4g}), throughput {_color(event['throughput'])}"


def _medium(event: Mapping[str, Any]) -> str:
    return f"{event['why']} at distance {event['distance']:.5g}, throughput {_color(event['throughput'])}"


def _ray(event: Mapping[str, Any]) -> str:
    return "visible" if max(event["visible"]) > 0 else "blocked"


_TEXTS: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "camera": _camera,
    "hit": _hit,
    "lobes": _lobes,
    "light sample": _light_sample,
    "emission": _emission,
    "gathered": lambda event: f"radiance {_color(event['radiance'])} in all",
    "scatter": _scatter,
    "roulette": _roulette,
    "medium": _medium,
    "pass": lambda event: event["why"],
    "dome ray": lambda event: f"towards the domes alone, {_ray(event)}",
    "outline ray": lambda event: f"towards the outline of {event['light']}, {_ray(event)}",
    "end": lambda event: event["why"],
}
