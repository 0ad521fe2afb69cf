"""Text of the log of one pixel's samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .pixel_log import PROBABILITIES

if TYPE_CHECKING:
    from .pixel_log import PixelLog


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
    before: tuple[int, int | None] | None = None
    for event in sample["events"]:
        place = event["vertex"], event.get("part")
        heading = f"vertex {place[0]}" + ("" if place[1] is None else f", part {place[1]}")
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
    rest = [f"{name} {_value(event[name])}" for name in ("alpha", "albedo", "mean_cosine") if name in event]
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
