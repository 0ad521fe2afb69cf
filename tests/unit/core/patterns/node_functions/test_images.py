"""Images in patterns: texels, address modes, what stands where there is none, and levels by the footprint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from tests import described

from primray.description import Floats, NodeOutput, Operand, Pattern, TextureFile

from ..oracle.numbers import Rows
from ..pictured import Graph, Strip, emitting, render_strips
from .test_procedural_places import plane, st

FILE = TextureFile("file", "raw")
MISSING = TextureFile("missing", "raw")
COUNT = 64
NOTHING: Mapping[str, Operand] = {}
DEFAULT = np.array([0.25, 0.5, 0.75], np.float32)


def texels(height: int, width: int, channels: int = 3) -> Floats:
    """Such as 16 bits hold exactly."""
    return (np.random.default_rng(3).integers(20, 236, (height, width, channels)) / 255).astype(np.float32)


def image(graph: Graph, at: Operand, type: str = "color3", changes: Mapping[str, Operand] = NOTHING) -> NodeOutput:
    default = (0.25, 0.5, 0.75, 1.0)[: {"float": 1, "vector2": 2, "color3": 3, "color4": 4}[type]]
    inputs: dict[str, Operand] = {
        "file": FILE, "default": default, "texcoord": at, "uaddressmode": "periodic", "vaddressmode": "periodic",
        "filtertype": "linear", **changes,
    }  # fmt: skip
    return graph.add("image", type, inputs)


def sampled(pixels: Floats, st: Floats, **changes: Operand) -> Rows:
    """The image at (N, 2) coordinates, as finely as it is; (N, 3)."""
    graph = Graph()
    source = image(graph, graph.primvar("at", "vector2"), changes=changes)
    strips = [Strip(emitting(graph.nodes, source), {"at": st})]
    return render_strips(strips, len(st), textures={FILE: described.image(pixels)})[0]


def bilinear(pixels: Floats, st: Floats | Rows, wrap: str) -> Rows:
    """Between texel centres; row 0 on top."""
    p = pixels[::-1].astype(np.float64)
    h, w = p.shape[:2]
    s = st.astype(np.float64)
    if wrap == "mirror":
        s = 1 - np.abs(st % 2 - 1)
    if wrap == "clamp":
        s = np.clip(s, 0, 1)
    x, y = s[:, 0] * w - 0.5, s[:, 1] * h - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = (x - i)[:, None], (y - j)[:, None]

    def at(j: Rows, i: Rows) -> Rows:
        inside = (np.mod(j, h), np.mod(i, w)) if wrap == "periodic" else (np.clip(j, 0, h - 1), np.clip(i, 0, w - 1))
        return np.asarray(p[inside])

    low, high = at(j, i) * (1 - u) + at(j, i + 1) * u, at(j + 1, i) * (1 - u) + at(j + 1, i + 1) * u
    return np.asarray(low * (1 - v) + high * v)


def coordinates() -> Floats:
    return np.random.default_rng(5).uniform(-1.8, 2.8, (COUNT, 2)).astype(np.float32)


@pytest.mark.parametrize("mode", ["periodic", "clamp", "mirror"])
def test_address_modes(mode: str) -> None:
    pixels, st = texels(8, 16), coordinates()
    found = sampled(pixels, st, uaddressmode=mode, vaddressmode=mode)
    np.testing.assert_allclose(found, bilinear(pixels, st, mode), atol=2e-4)


def test_constant_has_the_default_outside() -> None:
    pixels, st = texels(8, 16), coordinates()
    found = sampled(pixels, st, uaddressmode="constant", vaddressmode="constant")
    inside = ((st >= 0) & (st <= 1)).all(axis=1)
    np.testing.assert_array_equal(found[~inside], np.broadcast_to(DEFAULT, (int((~inside).sum()), 3)))
    np.testing.assert_allclose(found[inside], bilinear(pixels, st, "clamp")[inside], atol=2e-4)


def test_closest_is_a_texel() -> None:
    pixels, st = texels(8, 16), coordinates()
    found = sampled(pixels, st, filtertype="closest")
    cell = np.floor(np.mod(st, 1) * [16, 8]).astype(int)
    np.testing.assert_allclose(found, pixels[::-1][cell[:, 1], cell[:, 0]], atol=2e-4)


def test_file_that_cannot_be_read_is_the_default() -> None:
    found = sampled(texels(4, 4), coordinates(), file=MISSING)
    np.testing.assert_array_equal(found, np.broadcast_to(DEFAULT, found.shape))


def test_channels() -> None:
    """Four of a colour with alpha, two of a vector, one of a number."""
    pixels, at = texels(1, 1, 4), np.full((4, 2), 0.5, np.float32)
    for type, pick in (("color4", [0, 1, 2]), ("vector2", [1]), ("float", [0])):
        graph = Graph()
        source = image(graph, graph.primvar("at", "vector2"), type)
        if type == "vector2":
            source = graph.add("extract", "float", {"in": source, "index": (1.0,)})
        found = render_strips([Strip(emitting(graph.nodes, source), {"at": at})], 4, textures={FILE: described.image(pixels)})[
            0
        ]
        np.testing.assert_allclose(found[0], np.broadcast_to(pixels[0, 0, pick], 3), atol=1e-4)
    graph = Graph()
    source = graph.add("extract", "float", {"in": image(graph, graph.primvar("at", "vector2"), "color4"), "index": (3.0,)})
    found = render_strips([Strip(emitting(graph.nodes, source), {"at": at})], 4, textures={FILE: described.image(pixels)})[0]
    np.testing.assert_allclose(found[0], pixels[0, 0, 3], atol=1e-4)


def contrast(graph: Graph, source: NodeOutput, texels: int) -> float:
    """How far pixels are from the mean of an image of noise, seen whole in 16 x 16 pixels, in parts of its own texels'."""
    pixels = np.random.default_rng(7).uniform(0, 1, (texels, texels, 1)).astype(np.float32)
    camera = described.orthographic(described.translation(0, 0, 1), 9)
    mesh = plane((st(),))
    made = described.describe(
        [(mesh, np.eye(4))], [emitting(graph.nodes, source)], camera=camera, resolution=(16, 16),
        textures={FILE: described.image(pixels)},
    )  # fmt: skip
    found = described.render(made.build(), 1, max_depth=1, splits=1).pixels()[..., 0]
    return float(found.std() / pixels.std())


def place2d(graph: Graph, at: Operand, scale: float) -> NodeOutput:
    return graph.add("multiply", "vector2", {"in1": at, "in2": (scale, scale)})


@pytest.mark.parametrize("through", ["plain", "scaled", "tiled", "position"])
def test_levels_follow_the_footprint(through: str) -> None:
    """A texel's noise averages over the pixel: 16 x 8 texels of 1024 make one, whatever the coordinates went through."""
    graph = Graph()
    at: NodeOutput = graph.add("texcoord", "vector2", {"index": (0.0,)})
    if through == "scaled":
        at = place2d(graph, place2d(graph, at, 7.0), 1 / 7)
    if through == "tiled":  # jumps in between are no slopes
        whole = graph.add("floor", "vector2", {"in": place2d(graph, at, 64.0)})
        at = graph.add("subtract", "vector2", {"in1": place2d(graph, at, 1.0), "in2": whole})
    if through == "position":
        p = graph.add("position", "vector3", {"space": "object"})
        x, y = (graph.add("extract", "float", {"in": p, "index": (float(k),)}) for k in range(2))
        both = graph.add("combine2", "vector2", {"in1": x, "in2": y})
        at = graph.add("multiply", "vector2", {"in1": both, "in2": (1 / 9, 1 / 18)})
    source = image(graph, at, "float")
    found = contrast(graph, source, 256)
    # 16 pixels see 2 x 1 images of 256 texels: 32 x 16 of them make a pixel; one level up or down is a factor of 2.
    expected = 1 / np.sqrt(32 * 16)
    assert expected / 2.2 < found < expected * 2.2


@pytest.mark.parametrize("through", ["affine", "position"])
def test_levels_that_are_kept(through: str) -> None:
    """Only those that can be seen, where coordinates are a primvar's two numbers moved about; else all."""
    graph = Graph()
    at: NodeOutput = graph.add("texcoord", "vector2", {"index": (0.0,)})
    if through == "affine":
        at = graph.add("rotate2d", "vector2", {"in": place2d(graph, at, 2.0), "amount": (30.0,)})
    else:
        p = graph.add("position", "vector3", {"space": "object"})
        x, y = (graph.add("extract", "float", {"in": p, "index": (float(k),)}) for k in range(2))
        at = graph.add("combine2", "vector2", {"in1": x, "in2": y})
    surface = emitting(graph.nodes, image(graph, at, "float"))
    camera = described.orthographic(described.translation(0, 0, 1), 9)
    made = described.describe(
        [(plane((st(),)), np.eye(4))], [replace(surface, pattern=Pattern(tuple(graph.nodes)))], camera=camera,
        resolution=(16, 16), textures={FILE: described.image(texels(256, 256, 1))},
    )  # fmt: skip
    (kept,) = made.build().texture_images
    assert kept["first_level"] == (4 if through == "affine" else 0)


def test_height_to_normal_is_its_slope() -> None:
    """Of a height that rises along s and falls along t, coded as normal maps are."""
    graph = Graph()
    st_ = graph.add("texcoord", "vector2", {"index": (0.0,)})
    s, t = (graph.add("extract", "float", {"in": st_, "index": (float(k),)}) for k in range(2))
    rise, fall = (
        graph.add("multiply", "float", {"in1": s, "in2": (24.0,)}),
        graph.add("multiply", "float", {"in1": t, "in2": (8.0,)}),
    )
    height = graph.add("subtract", "float", {"in1": rise, "in2": fall})
    source = graph.add("heighttonormal", "vector3", {"in": height, "scale": (1.0,), "texcoord": st_})
    camera = described.orthographic(described.translation(0, 0, 1), 9)
    made = described.describe([(plane((st(),)), np.eye(4))], [emitting(graph.nodes, source)], camera=camera, resolution=(4, 4))
    found = described.render(made.build(), 1, max_depth=1, splits=1).pixels()[..., :3]
    n = np.array([-24 / 16, 8 / 16, 1])
    np.testing.assert_allclose(found, np.broadcast_to(n / np.linalg.norm(n) * 0.5 + 0.5, found.shape), atol=1e-3)
