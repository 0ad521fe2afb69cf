"""AOVs in files and by request: parts of an EXR, a product's render variables, flags, checkpoints."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.images.aovs.seen import stage_of
from tests.images.aovs.test_aovs import BODIES, SIZE, picture, values

from primray import render
from primray.aovs import AOVS
from primray.checkpoints.checkpointing import Checkpointing
from primray.checkpoints.merge import merge
from primray.cli import run
from primray.errors import LimitError, SettingsError
from primray.images.exr_parts import read_aovs
from primray.images.reading import read_measured
from primray.settings import RenderSettings

PRODUCT = """
def RenderSettings "settings"
{
    uniform int2 resolution = (72, 54)
    rel camera = </cam>
    rel products = </product>
}
def RenderProduct "product"
{
    rel orderedVars = [ORDERED]
}
"""


def variable(name: str, source: str, data_type: str = "", kind: str = "") -> str:
    lines = [f'uniform string sourceName = "{source}"']
    lines += [f'uniform token dataType = "{data_type}"'] if data_type else []
    lines += [f'uniform token sourceType = "{kind}"'] if kind else []
    return f'def RenderVar "{name}"\n{{\n    ' + "\n    ".join(lines) + "\n}\n"


def ordered(*variables: tuple[str, ...]) -> str:
    paths = ", ".join(f"</{v[0]}>" for v in variables)
    return BODIES + PRODUCT.replace("ORDERED", paths) + "".join(variable(*v) for v in variables)


def parts(path: Path) -> dict[str, Any]:
    """By part: its ImageSpec and its values as they are stored."""
    file: Any = oiio.ImageInput.open(str(path))
    found, number = {}, 0
    while file.seek_subimage(number, 0):
        spec = file.spec(number)
        found[spec.get_string_attribute("oiio:subimagename")] = (
            spec,
            file.read_image(number, 0, 0, spec.nchannels, oiio.UNKNOWN),
        )
        number += 1
    return found


def test_every_aov_is_a_part_of_the_exr(tmp_path: Path) -> None:
    image = picture(stage_of(BODIES), tuple(AOVS))
    path = image.save(tmp_path / "a.exr")
    found = parts(path)
    assert list(found) == ["rgba", *AOVS]
    first = found["rgba"][0]
    assert first.channelnames == ("R", "G", "B", "A", "stderr.R", "stderr.G", "stderr.B")
    assert first.get_string_attribute("primray:isa")
    windows = ("x", "y", "width", "height", "full_x", "full_y", "full_width", "full_height")
    for name, aov in image.aovs.items():
        spec, stored = found[name]
        assert spec.channelnames == aov.channels
        assert [getattr(spec, w) for w in windows] == [getattr(first, w) for w in windows]
        assert stored.dtype == (np.uint32 if AOVS[name].unsigned else np.float32)
        assert np.array_equal(stored.reshape(aov.values.shape), aov.values.astype(stored.dtype))
        assert not spec.get_string_attribute("primray:isa")
        assert spec.get_string_attribute("primray:meaning") == aov.meaning
        assert aov.meaning == AOVS[name].meaning.replace("a distance", "100 scene units")
        assert spec.getattribute("worldtocamera") == first.getattribute("worldtocamera")
    assert json.loads(found["prim"][0].get_string_attribute("primray:ids")) == {"1": "/a_ball", "2": "/b_box", "3": "/c_wall"}
    assert {spec.channelnames for spec, _ in found.values()} >= {("Z",), ("normal.X", "normal.Y", "normal.Z"), ("prim",)}


def test_who_reads_the_picture_alone_finds_it(tmp_path: Path) -> None:
    image = picture(stage_of(BODIES), ("depth", "prim"))
    path = image.save(tmp_path / "a.exr")
    back = read_measured(path)
    assert np.array_equal(back.pixels, image.pixels[..., :3])
    assert image.errors is not None
    assert back.stderr is not None
    assert np.array_equal(back.stderr, image.errors)
    aovs = read_aovs(path)
    assert np.array_equal(aovs["depth"].values, image.aovs["depth"].values)
    assert aovs["prim"].ids == image.aovs["prim"].ids
    assert run(["compare", str(path), str(path)]) == 0


def test_without_aovs_a_file_has_one_part_as_ever(tmp_path: Path) -> None:
    path = picture(stage_of(BODIES), ()).save(tmp_path / "a.exr")
    file: Any = oiio.ImageInput.open(str(path))
    assert not file.seek_subimage(1, 0)
    assert not file.spec(0).get_string_attribute("oiio:subimagename")
    assert read_aovs(path) == {}


@pytest.mark.conforms("RenderProduct.orderedVars", "RenderVar.dataType", "RenderVar.sourceName", "RenderVar.sourceType")
def test_a_products_variables_are_parts_under_their_names(tmp_path: Path) -> None:
    text = ordered(
        ("beauty", "Ci", "color3f"),
        ("alpha", "a", "float"),
        ("z", "cameraDepth", "float"),
        ("nrm", "Nn", "normal3f"),
        ("small", "N", "normal3h"),
        ("flat", "Ng", "color3f"),
        ("where", "P", "point3d"),
        ("uv", "st", "texCoord2f", "primvar"),
        ("ids", "primId", "int"),
        ("as_float", "primId", "float"),
        ("grey", "depth"),
        ("glow", "Emission", "color3f"),
        ("direct", "C<RD>[LO]", "color3f", "lpe"),
        ("all", "C.*", "color3f", "lpe"),
        ("albedo", ""),
    )
    stage = stage_of(text)
    image = render(stage, RenderSettings(spp=2))
    assert not [d for d in image.report["diagnostics"] if d["code"] == "render-var"]
    expected = {
        "z": (("z",), "depth", "float32"),
        "nrm": (("nrm.X", "nrm.Y", "nrm.Z"), "normal", "float32"),
        "small": (("small.X", "small.Y", "small.Z"), "normal", "float16"),
        "flat": (("flat.R", "flat.G", "flat.B"), "geometric_normal", "float32"),
        "where": (("where.X", "where.Y", "where.Z"), "position", "float32"),
        "uv": (("uv.U", "uv.V"), "st", "float32"),
        "ids": (("ids",), "prim", "uint32"),
        "as_float": (("as_float",), "prim", "float32"),
        "grey": (("grey.R", "grey.G", "grey.B"), "depth", "float32"),
        "glow": (("glow.R", "glow.G", "glow.B"), "emission", "float32"),
        "direct": (("direct.R", "direct.G", "direct.B"), "lpe:C<RD>[LO]", "float32"),
        "albedo": (("albedo.R", "albedo.G", "albedo.B"), "albedo", "float32"),
    }
    plain = picture(stage, tuple(AOVS))
    own_of = {**plain.aovs, "lpe:C<RD>[LO]": image.aovs["direct"]}
    found = parts(image.save(tmp_path / "a.exr"))
    assert list(found) == ["rgba", *expected]
    for name, (channels, source, dtype) in expected.items():
        spec, stored = found[name]
        assert (spec.channelnames, stored.dtype.name) == (channels, dtype)
        own = own_of[source].values.astype(dtype)
        stored = stored.reshape(SIZE[1], SIZE[0], -1)
        assert np.array_equal(stored, np.broadcast_to(own, stored.shape)), name
    assert image.report["aovs"]["ids"] == {
        "source": "prim",
        "channels": ["ids"],
        "stored": "uint",
        "meaning": AOVS["prim"].meaning,
        "ids": 3,
    }
    assert render(stage, RenderSettings(spp=1, aovs=())).aovs == {}


@pytest.mark.conforms("RenderVar.sourceName", "RenderVar.dataType", "RenderVar.sourceType", state="diagnosed")
@pytest.mark.parametrize(
    ("var", "attribute", "word"),
    [
        (("v", "C<RD>[<L.>O", "color3f", "lpe"), "sourceName", "at character 6, the [ has no ]"),
        (("v", "lpe:C<RD'floor'>L", "color3f"), "sourceName", "light path"),
        (("v", "cryptomatte", "color3f"), "sourceName", "cryptomatte"),
        (("v", "a b", "color3f", "primvar"), "sourceName", "primvar"),
        (("v", "z", "string"), "dataType", "string"),
    ],
)
def test_what_cannot_be_had_names_the_variable(var: tuple[str, ...], attribute: str, word: str) -> None:
    image = render(stage_of(ordered(var)), RenderSettings(spp=1))
    [found] = [d for d in image.report["diagnostics"] if d["code"] == "render-var"]
    assert found["prim_path"] == "/v"
    assert word in found["message"]
    assert list(image.aovs) == (["v"] if attribute == "dataType" else [])


def test_two_variables_of_one_name() -> None:
    text = BODIES + PRODUCT.replace("ORDERED", "</v>, </scope/v>") + variable("v", "z", "float")
    text += 'def Scope "scope"\n{\n' + variable("v", "N", "normal3f") + "}\n"
    image = render(stage_of(text), RenderSettings(spp=1))
    assert [d["prim_path"] for d in image.report["diagnostics"] if d["code"] == "render-var"] == ["/scope/v"]
    assert image.aovs["v"].source == "depth"


def test_a_primvar_as_whole_numbers() -> None:
    cube = 'def Cube "box"\n{\n    int primvars:tag = 16777215\n}\n'
    var = ("tag", "tag", "int", "primvar")
    text = cube + PRODUCT.replace("ORDERED", "</tag>") + variable(*var)
    aov = render(stage_of(text), RenderSettings(spp=1)).aovs["tag"]
    assert aov.values.dtype == np.uint32
    assert set(np.unique(aov.values).tolist()) == {0, 16777215}


def test_the_flag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out = tmp_path / "s.usda", tmp_path / "o.exr"
    stage = stage_of(ordered(("z", "depth", "float")))
    stage.GetRootLayer().Export(str(scene))

    def made(*flags: str) -> list[str]:
        assert run(["render", str(scene), "-o", str(out), "-p", "1", "-r", "16", "12", *flags]) == 0
        return list(read_aovs(out))

    assert made() == ["z"]
    assert made("--aov", "none") == []
    assert made("--aov", "depth,normal", "--aov", "primvar:st") == ["depth", "normal", "primvar:st"]
    assert made("--aov", "all", "--aov", "primvar:st,depth") == [*AOVS, "primvar:st"]
    assert made("--aov", "alpha,stderr,beauty") == []
    assert run(["render", str(scene), "-o", str(out), "--aov", "smell"]) == 2
    assert "unknown-aov" in capsys.readouterr().err
    assert run(["render", str(scene), "-o", str(tmp_path / "o.png"), "--aov", "depth"]) == 2
    assert "EXR" in capsys.readouterr().err
    assert run(["render", str(scene), "-o", str(tmp_path / "o.png"), "-p", "1", "-r", "16", "12"]) == 0


@pytest.mark.parametrize("name", ["", "Depth", "primvar:", "primvar:a b", "primvar:" + "x" * 300, "depth "])
def test_unknown_names_are_refused_with_those_that_there_are(name: str) -> None:
    with pytest.raises(SettingsError) as refused:
        RenderSettings(aovs=("normal", name))
    assert refused.value.code == "unknown-aov"
    for known in AOVS:
        assert known in refused.value.message


def test_they_count_for_the_memory_limit() -> None:
    stage = stage_of(BODIES)

    def fits(aovs: tuple[str, ...], limit: int) -> bool:
        try:
            render(stage, RenderSettings(resolution=(1000, 1000), spp=1, aovs=aovs, max_memory_bytes=limit), progress=stop)
        except LimitError:
            return False
        return True

    def stop(*_: object) -> None:
        return None

    assert fits((), 200 * 2**20)
    assert not fits(tuple(AOVS), 200 * 2**20)


def test_resumed_and_merged_renders_have_the_same(tmp_path: Path) -> None:
    stage = stage_of(BODIES)
    whole = picture(stage, ("depth", "albedo"))
    file = tmp_path / "c.prc"
    render(stage, RenderSettings(resolution=SIZE, spp=4, aovs=()), checkpointing=Checkpointing(file))
    settings = RenderSettings(resolution=SIZE, spp=8, aovs=("depth", "albedo"))
    resumed = render(stage, settings, checkpointing=Checkpointing(file, resume=file))
    for name in whole.aovs:
        assert np.array_equal(values(whole, name), values(resumed, name))

    halves = []
    for k in range(2):
        halves.append(tmp_path / f"{k}.prc")
        part = RenderSettings(resolution=SIZE, sample_range=(4 * k, 4 * k + 4), aovs=("depth",))
        render(stage, part, checkpointing=Checkpointing(halves[-1]))
    merged = merge(halves).image
    assert np.array_equal(merged.pixels, resumed.pixels)
    assert list(merged.aovs) == ["depth"]
    assert np.array_equal(values(merged, "depth"), values(resumed, "depth"))
    [told] = [d for d in merge(halves[1:]).image.report["diagnostics"] if d["code"] == "aovs-not-merged"]
    assert "depth" in told["message"]
