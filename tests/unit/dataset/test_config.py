"""Configs of data sets: what they refuse, and at which line and key."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from primray.dataset import Config, Sampler
from primray.errors import SettingsError

from .room import write_room

pytest.importorskip("yaml", reason="no PyYAML")

START = "stage: room.usda\nsamples: 2\n"


def parsed(tmp_path: Path, text: str) -> Config:
    write_room(tmp_path)
    return Config.parse(START + textwrap.dedent(text), tmp_path, "set.yaml")


@pytest.mark.parametrize(
    ("text", "line", "key", "says"),
    [
        ("sed: 3", 3, "sed", "did you mean seed"),
        ("seed: 1\nseed: 2", 4, "seed", "there twice, first in line 3"),
        ("seed: 1.5", 3, "seed", "a whole number"),
        ("settings: {spp: many}", 3, "settings.spp", "spp"),
        ("settings:\n  sp: 3", 4, "settings.sp", "did you mean spp"),
        ("settings: {time_limit_s: 3}", 3, "settings.time_limit_s", "clock"),
        ("settings: {threads: 3}", 3, "settings.threads", "flag"),
        ("pictures: [png, gif]", 3, "pictures[1]", "'gif' is not known"),
        ("write: [cocoa]", 3, "write[0]", "cocoa"),
        ("vary:\n  lamp: {to: 3}", 4, "vary.lamp", "which says what varies"),
        ("vary:\n  lamp:\n    attribute: /a.b\n    too: 3", 6, "vary.lamp.too", "did you mean to"),
        ("vary:\n  lamp:\n    attribute: /a.b", 4, "vary.lamp", "'to' is missing"),
        ("vary:\n  s: {setting: exposure, to: 1}", 4, "vary.s.setting", "no setting"),
        ("vary:\n  s: {setting: filter, to: gauss}", 4, "vary.s.to", "filter must be"),
        ("vary:\n  p: {pose: /a}", 4, "vary.p", "translate, rotate, scale or from"),
        ("vary:\n  p: {pose: /a, translate: 3}", 4, "vary.p.translate", "three numbers"),
        ("vary:\n  p: {pose: /a, from: no.npy}", 4, "vary.p.from", "cannot be read"),
        ("vary:\n  v: {variant: /a}", 4, "vary.v.variant", "no variant set"),
        ("vary:\n  c: {shell: /a, distance: [3, 2]}", 4, "vary.c.distance", "above the greatest"),
        ("vary:\n  c: {shell: [0, 0], distance: 2}", 4, "vary.c.shell", "a list of 3 numbers"),
        ("vary:\n  c: {shell: /a, distance: 2, elevation: [0, 91]}", 4, "vary.c.elevation", "-90 to 90"),
        ("vary:\n  c: {shell: /a, distance: 2, distortion: [1]}", 4, "vary.c.distortion", "needs intrinsics"),
        ("vary:\n  s: {scatter: /a, surface: /b, gap: -1}", 4, "vary.s.gap", "-1 is not 0 or more"),
        ("labels: {taxonomy: class, classes: [a, a]}", 3, "labels.classes", "twice"),
        ("light: false", 3, "light", "what a sample has"),
        ("light: false\npictures: [png]", 4, "pictures", "png is a picture"),
        ("light: false\nlabels: {}\nsettings: {aovs: [crypto_object]}", 5, "settings.aovs", "made of light"),
        ("light: false\nlabels: {}\nwrite: [coco]", 5, "write", "coco needs png"),
    ],
)
def test_a_mistake_is_named_by_line_and_key(tmp_path: Path, text: str, line: int, key: str, says: str) -> None:
    with pytest.raises(SettingsError, match=says) as caught:
        parsed(tmp_path, text)
    assert caught.value.where == f"set.yaml:{line}: {key}"
    assert caught.value.code == "dataset-config"


def test_what_is_no_yaml_is_named_by_line(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no YAML") as caught:
        parsed(tmp_path, "vary: [a, b")
    assert caught.value.where.startswith("set.yaml:")


def test_a_stage_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="there is no file") as caught:
        Config.parse("samples: 2\nstage: no.usda", tmp_path, "set.yaml")
    assert caught.value.where == "set.yaml:2: stage"


@pytest.mark.parametrize(
    ("entry", "says", "where"),
    [
        ("{attribute: /World/lmp.inputs:intensity, to: 1}", "did you mean lamp", "/World/lmp"),
        ("{attribute: /World/lamp.inputs:intensty, to: 1}", "did you mean inputs:intensity", "inputs:intensty"),
        ("{attribute: /World/lamp.inputs:intensity, to: bright}", "'bright' is no value of .* float", "inputs:intensity"),
        ("{attribute: /World/props/*.primvars:displayColor, to: [1, 2]}", "is no value", "displayColor"),
        ("{variant: '/World:look'}", "no variant set look", "/World"),
        ("{scatter: /World/props/*, surface: /World/lamp}", "no surface", "/World/lamp"),
        ("{shell: /World/nothing, distance: 1}", "no such prim", "/World/nothing"),
        ("{pose: /World/props/d*, rotate: any}", "no such prim", "/World/props/d"),
    ],
)
def test_what_the_stage_does_not_have_is_named_with_its_line(tmp_path: Path, entry: str, says: str, where: str) -> None:
    config = parsed(tmp_path, f"vary:\n  x: {entry}")
    with pytest.raises(SettingsError, match=says) as caught:
        Sampler(config).check()
    assert caught.value.where.startswith("set.yaml:4: vary.x")
    assert where in caught.value.where
    assert caught.value.code == "dataset-target"


def test_numbers_that_yaml_takes_for_text_are_numbers(tmp_path: Path) -> None:
    config = parsed(tmp_path, "vary:\n  x: {attribute: /World/lamp.inputs:intensity, to: {uniform: [1e1, 1e2]}}")
    drawn, _ = Sampler(config).apply(0)
    assert 10 <= drawn["x"]["/World/lamp.inputs:intensity"] <= 100


@pytest.mark.parametrize(
    "text",
    [
        "vary: &a\n  b: *a",
        "vary: {a: &a [x, x, x, x, x, x, x, x, x, x]"
        + "".join(f", {n}: &{n} [{', '.join([f'*{m}'] * 10)}]" for m, n in zip("abcdefgh", "bcdefghi", strict=True))
        + "}",
    ],
)
def test_aliases_without_end_are_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(SettingsError, match="an alias") as error:
        parsed(tmp_path, text)
    assert error.value.where.startswith("set.yaml:3")


def test_a_table_that_is_not_there_and_a_taxonomy_without_a_name_are_refused(tmp_path: Path) -> None:
    for text, key, says in (("{table: no.json}", "table", "there is no file"), ("{taxonomy: ''}", "taxonomy", "has a name")):
        with pytest.raises(SettingsError, match=says) as error:
            parsed(tmp_path, f"labels: {text}")
        assert error.value.where == f"set.yaml:3: labels.{key}"


def test_a_list_or_table_without_a_class_of_the_stage_says_which(tmp_path: Path) -> None:
    from primray.dataset import make

    (tmp_path / "ids.json").write_text('{"classes": {"class": {"ball": 7}}}')
    small = "settings: {resolution: [8, 6], spp: 1}\nlabels: "
    for labels, says in (
        ("{classes: [ball]}", "labels: classes lacks .*: box"),
        ("{table: ids.json}", "ids.json has no ids .*: box"),
    ):
        with pytest.raises(SettingsError, match=says) as error:
            make(parsed(tmp_path, small + labels), tmp_path / says[:4])
        assert error.value.code == "dataset-classes"
