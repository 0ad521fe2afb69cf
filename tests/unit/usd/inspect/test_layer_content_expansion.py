"""Counting what a scene expands to, against what USD composes where that ends."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd

from primray.usd.inspect.layer_content import expansion, layer_content


def counted(folder: Path, layers: dict[str, str]) -> tuple[int, int]:
    """Of the first layer."""
    for name, text in layers.items():
        (folder / name).write_text(text)
    contents = {name: layer_content(str(folder / name), name) for name in layers}
    found = expansion(contents, next(iter(layers)), lambda _, path: path if path in contents else None)
    assert found is not None
    return found.expanded, found.composed


def composed(folder: Path, layers: dict[str, str]) -> int:
    stage = Usd.Stage.Open(str(folder / next(iter(layers))))
    return sum(1 for _ in Usd.PrimRange.AllPrims(stage.GetPseudoRoot())) - 1


TREE = 'def "t" {\n def "u" {\n }\n def "v" {\n  def "w" {\n  }\n }\n}\n'
VARIANTS = """def "m" (
    variantSets = "v"
    variants = { string v = "y" }
) {
    variantSet "v" = {
        "x" {
        }
        "y" (references = </t>) {
            def "z" {
            }
        }
    }
}
"""
CASES = {
    "plain": {"a.usda": f"#usda 1.0\n{TREE}"},
    "reference": {"a.usda": f'#usda 1.0\n{TREE}def "r" (references = </t>) {{\n}}\ndef "s" (inherits = </t/v>) {{\n}}\n'},
    "file": {
        "a.usda": '#usda 1.0\ndef "r" (references = @b.usda@) {\n}\ndef "p" (payload = @b.usda@</t/v>) {\n}\n',
        "b.usda": f'#usda 1.0\n(defaultPrim = "t")\n{TREE}',
    },
    "sublayer": {"a.usda": "#usda 1.0\n(subLayers = [@b.usda@])\n", "b.usda": f"#usda 1.0\n{TREE}"},
    "reference to a stack": {
        "a.usda": '#usda 1.0\ndef "r" (references = @b.usda@</t>) {\n}\n',
        "b.usda": "#usda 1.0\n(subLayers = [@c.usda@])\n",
        "c.usda": f"#usda 1.0\n{TREE}",
    },
    "variant": {"a.usda": f"#usda 1.0\n{VARIANTS}{TREE}"},
}


@pytest.mark.parametrize("name", CASES)
def test_as_usd_composes(name: str, tmp_path: Path) -> None:
    layers = CASES[name]
    expanded, prims = counted(tmp_path, layers)
    assert expanded == prims == composed(tmp_path, layers)


def test_instances_count_for_the_renderer_and_not_for_usd(tmp_path: Path) -> None:
    prims = "".join(f'def "i{n}" (instanceable = true\n references = </t>) {{\n}}\n' for n in range(5))
    assert counted(tmp_path, {"a.usda": f"#usda 1.0\n{TREE}{prims}"}) == (4 + 5 * 4, 4 + 5)


def test_circles_and_missing_layers_end(tmp_path: Path) -> None:
    text = (
        '#usda 1.0\n(subLayers = [@a.usda@])\ndef "a" (references = [</b>, @no.usda@]) {\n}\ndef "b" (references = </a>) {\n}\n'
    )
    assert counted(tmp_path, {"a.usda": text})[0] >= 2


def test_long_chains_are_followed(tmp_path: Path) -> None:
    """As many arcs one after the other as there may be layers, and prims as deep as they may be."""
    chain = "".join(f'def "l{n}" (references = </l{n + 1}>) {{\n}}\n' for n in range(2000))
    deep = 'def "d" {\n' * 900 + "}\n" * 900
    assert counted(tmp_path, {"a.usda": f'#usda 1.0\n{chain}def "l2000" {{\n def "x" {{\n }}\n}}\n{deep}'})[0] == 2 * 2001 + 900


def test_large_layers_are_not_counted(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text("#usda 1.0\n" + "".join(f'def "p{n}" {{\n}}\n' for n in range(20_001)))
    content = layer_content(str(tmp_path / "a.usda"), "a.usda")
    assert content.root is None
    assert expansion({"a.usda": content}, "a.usda", lambda *_: None) is None
