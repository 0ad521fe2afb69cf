"""Text of what `primray doctor SCENE` found."""

from __future__ import annotations

from typing import Any

from ..messages.diagnostics_text import diagnostics_lines, fidelity_text

_PRIMS_SHOWN = 3
_TITLES = {
    "empty": "Why is something not there?",
    "dark": "Why is it dark, or bright?",
    "grey": "Why is it grey?",
    "slow": "Why is it slow?",
}


def lines(facts: dict[str, Any], verbose: bool) -> list[str]:
    """Return a few lines of figures, then the findings by question, then the remaining diagnostics of the stage."""
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
    from .performance import duration

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
        return "unknown: no visible surface has an error"
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
