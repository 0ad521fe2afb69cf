"""What `primray doctor SCENE` found, as data and as a person reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...notices.diagnostics_text import diagnostics_lines, fidelity_text

if TYPE_CHECKING:
    from ...examining.examined import Examined

_PRIMS_SHOWN = 3
_TITLES = {
    "empty": "Why is something not there?",
    "dark": "Why is it dark, or bright?",
    "grey": "Why is it grey?",
    "slow": "Why is it slow?",
}


def facts_of(scene: str, seen: Examined) -> dict[str, Any]:
    """As JSON: what was measured, and what follows."""
    from ...examining import dark, empty, grey, noise, slow

    found = [finding for module in (empty, dark, grey, slow, noise) for finding in module.findings(seen)]
    lights = [(light.path, light.type.value) for light in seen.description.lights]
    camera, bounds, unit = seen.prepared.camera, seen.prepared.scene.bounds, seen.description.meters_per_unit
    width, height = seen.prepared.frame.size
    return {
        "type": "doctor",
        "scene": scene,
        "picture": {
            "camera": camera.path,
            "resolution": [width, height],
            "hit_share": seen.hit_share,
            "grey_share": grey.grey_share(seen),
            "bounds": None if bounds is None else [[float(v) for v in corner] for corner in bounds],
            "camera_position": [float(v) for v in camera.world_from_camera[:3, 3]],
            "meters_per_unit": unit,
            "up_axis": seen.description.up_axis,
            "lights": [{"path": path, "type": kind} for path, kind in lights],
        },
        "set_up_s": slow.set_up_seconds(seen),
        "speed": slow.speed(seen),
        "counts": dict(seen.prepared.counts),
        "time_to_1_percent": noise.time_to_error(seen),
        "findings": [finding.as_json() for finding in found],
        "diagnostics": [diagnostic.as_json() for diagnostic in seen.diagnostics],
    }


def lines(facts: dict[str, Any], verbose: bool) -> list[str]:
    """A few lines of figures, then by question what was found, then what else the stage has to tell."""
    told = [*_figures(facts)]
    for question, title in _TITLES.items():
        found = [finding for finding in facts["findings"] if finding["question"] == question]
        if found:
            told += ["", title]
            for finding in found:
                told += _finding(finding, verbose)
    if not facts["findings"]:
        told += ["", "Nothing was found that makes it slow, grey, dark or empty."]
    explained = {finding["code"] for finding in facts["findings"]}
    rest = [row for row in facts["diagnostics"] if row["code"] not in explained and (verbose or row["severity"] != "info")]
    if rest:
        told += ["", f"What else differs from the stage: {fidelity_text(rest)}", *diagnostics_lines(rest, verbose=verbose)]
    return told


def _figures(facts: dict[str, Any]) -> list[str]:
    from ...examining.noise import duration

    picture, speed, counts = facts["picture"], facts["speed"], facts["counts"]
    width, height = picture["resolution"]
    grey = "" if picture["grey_share"] is None else f", {picture['grey_share']:.0%} of that grey"
    took = facts["set_up_s"]
    steps = ", ".join(f"{name} {seconds:.2f}" for name, seconds in took.items())
    rows = [
        ("camera", f"{picture['camera'] or 'automatic'}, {width} x {height}"),
        ("sees", f"surfaces in {picture['hit_share']:.1%} of the picture{grey}"),
        ("lights", ", ".join(_kinds(picture["lights"])) or "none"),
        (
            "geometry",
            f"{counts['triangles_unique']:,} triangles, {counts['instances']:,} instances, {counts['textures']} textures",
        ),
        ("set-up", f"{sum(took.values()):.2f} s: {steps}"),
        ("speed", f"{speed['rays_per_s'] / 1e6:.2f} million rays/s, {speed['rays_per_sample']:.1f} rays a sample"),
        ("to 1 %", _to_one_percent(facts["time_to_1_percent"], duration)),
    ]
    return [f"{name:9} {text}" for name, text in rows]


def _kinds(lights: list[dict[str, str]]) -> list[str]:
    kinds = [light["type"] for light in lights]
    return [f"{kinds.count(kind):,} {kind}" for kind in dict.fromkeys(kinds)]


def _to_one_percent(found: dict[str, Any] | None, duration: Any) -> str:
    if found is None:
        return "not known: nothing that is seen has an error"
    if found["seconds"] is None:
        return "more samples than are allowed"
    seconds, samples = found["seconds"], found["samples"]
    low, high = (duration(value) for value in seconds["ci95"])
    return f"about {duration(seconds['estimate'])} ({low} to {high}), {samples['estimate']:,.0f} samples a pixel"


def _finding(finding: dict[str, Any], verbose: bool) -> list[str]:
    shown = finding["prims"] if verbose else finding["prims"][:_PRIMS_SHOWN]
    shown = [path for path in shown if path]
    more = f" and {len(finding['prims']) - len(shown):,} more" if len(finding["prims"]) > len(shown) and shown else ""
    told = [f"  {finding['code']}: {finding['message']}"]
    told += [f"    at {', '.join(shown)}{more}"] if shown else []
    return [*told, f"    -> {finding['advice']}"]
