"""Materials that are translated by a recipe: surfaces and messages are those of materials that are translated one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.unit.usd import usd_text

from primray.description import SceneDescription
from primray.diagnostics import Diagnostic
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.materials import recipes

NUMBERS = ("0", "1", "0.5", "0.25", "-0.5", "2", "0.8", "-0", "1e-6")  # those that rules of nodes look for among them
NODES = {
    "color3": {
        "multiply": ("in1", "in2"),
        "add": ("in1", "in2"),
        "divide": ("in1", "in2"),
        "power": ("in1", "in2"),
        "mix": ("fg", "bg"),
        "clamp": ("in", "low", "high"),
        "contrast": ("in", "amount", "pivot"),
        "rgbtohsv": ("in",),
        "convert_float": ("in",),
    },
    "float": {
        "multiply": ("in1", "in2"),
        "subtract": ("in1", "in2"),
        "mix": ("fg", "bg", "mix"),
        "ifgreater": ("value1", "value2", "in1", "in2"),
        "fractal3d": ("amplitude", "lacunarity"),
        "smoothstep": ("in", "low", "high"),
        "luminance": (),
        "time": (),
    },
}
SURFACES = (
    ("standard_surface_surfaceshader", ("base_color", "coat_color"), ("specular_roughness", "metalness", "coat", "sheen")),
    ("open_pbr_surface_surfaceshader", ("base_color", "fuzz_color"), ("specular_roughness", "transmission_weight")),
    ("gltf_pbr_surfaceshader", ("base_color",), ("roughness", "metallic", "clearcoat")),
)


SPACES = (None, "lin_ap1_scene")


class Shape:
    """A random network; `text` writes it with random numbers."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.surface, colors, floats = SURFACES[rng.integers(len(SURFACES))]
        self.nodes: list[tuple[str, str, list[tuple[str, str, str]]]] = []  # name, id, inputs (type, name, source)
        for k in range(int(rng.integers(1, 7))):
            self._node(k)
        self.inputs = [("color3", name, self._source("color3")) for name in colors]
        self.inputs += [("float", name, self._source("float")) for name in floats]
        self.interface = bool(rng.integers(2))
        self.odd = str(rng.choice(["", "", "", "", "unknown", "space", "wrong"]))

    def _node(self, k: int) -> None:
        kind = str(self.rng.choice(list(NODES)))
        name = str(self.rng.choice(list(NODES[kind])))
        given = [("float" if name in ("convert_float",) or each == "mix" else kind, each) for each in NODES[kind][name]]
        if name == "luminance":
            kind, given = "color3", [("color3", "in")]
        identifier = (
            "ND_convert_float_color3" if name == "convert_float" else "ND_time_float" if name == "time" else f"ND_{name}_{kind}"
        )
        self.nodes.append((f"n{k}", identifier, [(of, each, self._source(of)) for of, each in given]))

    def _source(self, kind: str) -> str:
        """The name of an earlier node, often of another type than the input; "" for a number."""
        if not self.nodes or self.rng.random() < 0.4:
            return ""
        same = [n for n, i, _ in self.nodes if i.endswith(kind)]
        return str(self.rng.choice(same)) if same and self.rng.random() < 0.8 else self.nodes[-1][0]

    def _value(self, kind: str) -> str:
        several = [str(self.rng.choice(NUMBERS)) if self.rng.random() < 0.5 else f"{self.rng.random():.4g}" for _ in range(3)]
        return several[0] if kind == "float" else f"({', '.join(several)})"

    def _input(self, at: str, given: tuple[str, str, str], more: str = "") -> str:
        kind, name, source = given
        start = f"{'color3f' if kind == 'color3' else 'float'} inputs:{name}"
        return f"{start}.connect = <{at}/{source}.outputs:out>" if source else f"{start} = {self._value(kind)}{more}"

    def text(self, name: str) -> str:
        at, lines = f"/{name}", [f'def Material "{name}" {{', f"token outputs:mtlx:surface.connect = </{name}/s.outputs:out>"]
        if self.interface:
            lines.append(f"float inputs:shared = {self._value('float')}")
        for k, (node, identifier, given) in enumerate([*self.nodes, ("s", f"ND_{self.surface}", self.inputs)]):
            lines += [f'def Shader "{node}" {{', f'uniform token info:id = "{identifier}"']
            for number, each in enumerate(given):
                if k == 0 and number == 0 and self.odd == "space" and not each[2]:
                    lines.append(self._input(at, each, ' ( colorSpace = "srgb_rec709_scene" )'))
                elif k == 0 and number == 0 and self.interface and each[0] == "float":
                    lines.append(f"float inputs:{each[1]}.connect = <{at}.inputs:shared>")
                elif k == 0 and number == 0 and self.odd == "wrong":
                    lines.append(f'string inputs:{each[1]} = "x"')
                else:
                    lines.append(self._input(at, each))
            lines += ["float inputs:nothing = 1"] if k == 0 and self.odd == "unknown" else []
            lines += ["token outputs:out", "}"]
        return "\n".join([*lines, "}", f'def Sphere "ball_{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{',
                          f"rel material:binding = <{at}>", "}"])  # fmt: skip


def stage_of(seed: int) -> str:
    """Several networks, each as six materials with other numbers, mixed; all have the same names where they can."""
    rng = np.random.default_rng(seed)
    shapes = [Shape(rng) for _ in range(4)]
    order = rng.permutation([k for k in range(len(shapes)) for _ in range(6)])
    return "\n".join(shapes[k].text(f"m{place}") for place, k in enumerate(order))


def described(text: str) -> tuple[SceneDescription, list[Diagnostic]]:
    scene, told = translate(usd_text.stage_of(text), RenderSettings(rendering_color_space=SPACES[len(text) % 2]))
    return scene, list(told)


@pytest.mark.parametrize("seed", range(25))
def test_recipes_change_neither_surfaces_nor_messages(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = stage_of(seed)
    found, told = described(text)
    monkeypatch.setattr(recipes, "MOST", 0)
    expected, expected_told = described(text)
    assert found.surfaces == expected.surfaces
    assert repr(found.surfaces) == repr(expected.surfaces)  # -0 and 0 as well
    assert told == expected_told


def test_materials_of_one_network_are_translated_by_its_recipe(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    before = recipes.Recipe.material

    def counted(self: recipes.Recipe, *of: Any) -> Any:
        made.append(before(self, *of))
        return made[-1]

    monkeypatch.setattr(recipes.Recipe, "material", counted)
    for seed in range(25):
        described(stage_of(seed))
    assert sum(material is not None for material in made) > 80  # of 600: many have a fault or read the time
