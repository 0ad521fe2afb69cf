"""The output `lights` as light path expressions: one for each light group, for each light without one, and one for the rest."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from ..aovs import LIGHT_PATH, LIGHTS, AovRequest, light_paths_of
from ..description import Light, SceneDescription
from ..description.picture_file import PictureFile
from ..diagnostics import Diagnostics
from ..images.exr_parts import LIGHTS_OF_PART
from ..lpe.automaton import MOST_EXPRESSIONS

# What has a meaning in channels, mixes, lists of names or a shell: blanks, and all punctuation but "_", "-", "+", "/" and ":".
NO_WORD = re.compile(r"[\s\x00-\x1f!-*,.;-@\[-^`{-\x9f]")
REST = "rest"  # emissive surfaces, and lights that have no part of their own


def with_lights_apart(description: SceneDescription, diagnostics: Diagnostics) -> SceneDescription:
    """Return the description with an output for each light in place of `lights`; the same object if that is not asked for.

    Outputs are named lights.NAME, after the group or the last names of the light's path that tell it from others. Lights beyond
    the expressions of one render, and what glows without being a light, are in lights.rest.
    """
    if all(request.source != LIGHTS for request in description.aovs):
        return description
    others = [request for request in description.aovs if request.source != LIGHTS]
    labels = _labels(_lights_of(description), diagnostics)
    most = MOST_EXPRESSIONS - 1 - len(light_paths_of(others))
    if len(labels) > most:
        left = list(labels)[max(most, 0) :]
        message = f"{len(left)} of {len(labels)} lights and light groups have no part of their own: {', '.join(left[:4])}"
        message += (
            f"{' and others' if len(left) > 4 else ''} are in lights.{REST}. Light groups put several lights in one part."
        )
        diagnostics.add("light-parts", "", message)
        labels = dict(list(labels.items())[: max(most, 0)])
    asked = [request for request in description.aovs if request.source == LIGHTS]
    made = tuple(_requests(labels, asked[0]))
    aovs = tuple(one for request in description.aovs if request not in asked[1:] for one in _replaced(request, made))
    return replace(
        description,
        aovs=aovs,
        lights_apart=tuple(labels),
        file=with_parts(description.file, {request.name for request in asked}, [request.name for request in made]),
    )


def _replaced(request: AovRequest, made: tuple[AovRequest, ...]) -> tuple[AovRequest, ...]:
    return made if request.source == LIGHTS else (request,)


def with_parts(file: PictureFile, asked: Collection[str], names: Sequence[str]) -> PictureFile:
    """Return a product's file with the parts of these names in place of those that were asked for."""
    contents = file.contents
    if contents is not None:
        parts = [p for own, key in contents.parts for p in ([(n, n) for n in names] if key in asked else [(own, key)])]
        contents = replace(contents, parts=tuple(dict.fromkeys(parts)))
    products = tuple((path, with_parts(one, asked, names)) for path, one in file.products)
    return replace(file, contents=contents, products=products)


def _lights_of(description: SceneDescription) -> Iterable[Light]:
    yield from description.lights
    for shape in description.shapes:
        if shape.light is not None:
            yield shape.light


def _labels(lights: Iterable[Light], diagnostics: Diagnostics) -> dict[str, list[str]]:
    """Return the paths of lights by group, or by the light's path without one. Lights that emit nothing are reported."""
    found: dict[str, list[str]] = {}
    dark: dict[str, None] = {}
    for light in lights:
        if not any(light.emission):
            dark[light.path] = None
            continue
        paths = found.setdefault(light.group or light.path, [])
        if light.path not in paths:
            paths.append(light.path)
    for path in dark:
        message = "The light emits nothing, so no part holds its light, and no mix can make it brighter."
        diagnostics.add("light-parts", path, message)
    return found


def _requests(labels: Mapping[str, Sequence[str]], asked: AovRequest) -> Iterable[AovRequest]:
    names = names_of(list(labels))
    for label, paths in labels.items():
        yield _request(names[label], f"C.*<L.'{label}'>", paths, asked)
    quoted = " ".join(f"'{label}'" for label in labels)
    yield _request(REST, f"C.*(O|<L.[^{quoted}]>)" if labels else "C.*[LO]", (), asked)


def _request(name: str, expression: str, paths: Sequence[str], asked: AovRequest) -> AovRequest:
    return AovRequest(
        f"{LIGHTS}.{name}",
        LIGHT_PATH + expression,
        errors=asked.errors,
        differences=True,
        header=((LIGHTS_OF_PART, json.dumps(list(paths), ensure_ascii=False)),),
    )


def names_of(labels: Sequence[str]) -> dict[str, str]:
    """Return a name of a part for each group or path: as much of a path's end as no other has, without NO_WORD."""
    plain = {label: _words(label) for label in labels}
    found: dict[str, str] = {}
    for label, words in plain.items():
        others = [other for other in labels if other != label]
        for count in range(1, len(words) + 1):
            name = "_".join(words[-count:])
            if name != REST and all("_".join(plain[other][-count:]) != name for other in others):
                break
        else:
            name = "_".join(words)
        while name in found.values() or name == REST:
            name += "_"
        found[label] = name
    return found


def _words(label: str) -> tuple[str, ...]:
    words = PurePosixPath(label).parts[1:] if label.startswith("/") else (label,)
    return tuple(NO_WORD.sub("_", word) for word in words) or ("light",)
