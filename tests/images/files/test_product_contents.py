"""What a product orders is what its file holds, where its name says; products of one picture are made by one render."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.cli import run

SPHERE = """
def Sphere "ball" { color3f[] primvars:displayColor = [(0.8, 0.2, 0.1)]
}
def Camera "near" { double3 xformOp:translate = (0, 0, 12)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "far" { double3 xformOp:translate = (0, 0, 20)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky" { float inputs:intensity = 1
}
"""
VARIABLES = {
    "rgb": 'string sourceName = "Ci"',
    "rgba": 'string sourceName = "Ci"\n token dataType = "color4f"',
    "alpha": 'string sourceName = "a"\n token dataType = "float"',
    "noise": 'string sourceName = "stderr"',
    "z": 'string sourceName = "depth"\n token dataType = "float"',
    "N": 'string sourceName = "N"\n token dataType = "normal3f"',
    "light": 'string sourceName = "C.*[LO]"\n token sourceType = "lpe"\n token dataType = "color4f"',
    "key": 'string sourceName = "C<RD>L"\n token sourceType = "lpe"',
    "apart": 'string sourceName = "lights"',
    "halves": 'string sourceName = "lights"\n token dataType = "half3"',
    "nothing": 'string sourceName = "unheard_of"',
}


def targets(names: str) -> str:
    return ", ".join(f"</Render/{name}>" for name in names.split())


def write(path: Path, products: dict[str, tuple[str, str]], variables: str = "") -> None:
    """`products`: by prim name the names of its variables, and further lines."""
    made = "".join(
        f'def RenderProduct "{name}" {{ rel orderedVars = [{targets(ordered)}]\n {lines}\n}}\n'
        for name, (ordered, lines) in products.items()
    )
    of_all = "".join(f'def RenderVar "{name}" {{ {lines}\n}}\n' for name, lines in VARIABLES.items())
    listed = targets(" ".join(products))
    path.write_text(f"""#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 2
)
{SPHERE}
def Scope "Render" {{
def RenderSettings "settings" {{ rel products = [{listed}]
 rel camera = </near>
 int2 resolution = (24, 16)
}}
{made}{of_all}{variables}
}}
""")


def parts(path: Path) -> dict[str, tuple[str, ...]]:
    """The channels of a file's parts, in order."""
    import OpenImageIO as oiio

    file, found = oiio.ImageInput.open(str(path)), dict[str, tuple[str, ...]]()
    assert file is not None
    while file.seek_subimage(len(found), 0):
        found[file.spec().get_string_attribute("oiio:subimagename", "rgba")] = tuple(file.spec().channelnames)
    file.close()
    return found


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def rendered(*flags: str) -> int:
    return run(["render", "s.usda", "--spp", "2", *flags])


RGBA, STDERR = ("R", "G", "B", "A"), ("stderr.R", "stderr.G", "stderr.B")
LIGHTS_APART = {
    f"lights.{name}": tuple(f"lights.{name}.{channel}" for channel in ("R", "G", "B", *(f"difference.{c}" for c in "RGB")))
    for name in ("sky", "rest")
}
Z, N = {"z": ("z",)}, {"N": ("N.X", "N.Y", "N.Z")}


@pytest.mark.parametrize(
    ("ordered", "flags", "expected"),
    [
        ("", [], {"rgba": RGBA}),
        ("rgb", [], {"rgba": RGBA[:3]}),
        ("rgb alpha", [], {"rgba": RGBA}),
        ("rgba", [], {"rgba": RGBA}),
        ("light", [], {"rgba": RGBA}),
        ("rgba noise", [], {"rgba": RGBA + STDERR}),
        ("noise", [], {"rgba": STDERR}),
        ("N z", [], N | Z),
        ("z rgb", [], {"rgba": RGBA[:3], **Z}),
        ("rgba apart z", [], {"rgba": RGBA, **LIGHTS_APART, **Z}),
        ("rgba apart halves", [], {"rgba": RGBA, **LIGHTS_APART}),
        ("nothing", [], {"rgba": RGBA}),
        ("N", ["--record"], {"rgba": RGBA + STDERR} | N),
        ("N", ["--aov", "depth"], {"rgba": RGBA, "depth": ("Z",)}),
        ("N", ["--aov", "depth,stderr"], {"rgba": RGBA + STDERR, "depth": ("Z",)}),
    ],
)
@pytest.mark.filterwarnings("ignore::primray.RenderWarning")
def test_a_file_holds_what_its_product_orders(ordered: str, flags: list[str], expected: dict[str, Any]) -> None:
    write(Path("s.usda"), {"a": (ordered, ""), "b": ("rgba", "rel camera = </far>")})
    assert rendered("--all-products", *flags) == 0
    assert parts(Path("a.exr")) == expected
    assert list(parts(Path("a.exr"))) == list(expected)
    assert parts(Path("b.exr"))["rgba"][:4] == RGBA


@pytest.mark.conforms("RenderProduct.orderedVars")
def test_products_of_one_picture_are_one_render(capsys: pytest.CaptureFixture[str]) -> None:
    other = """def RenderVar "own" { token driver:parameters:aov:name = "N"
 string sourceName = "Neye"
 token dataType = "normal3h"
}
"""
    products = {
        "a": ("rgba N z", ""),
        "b": ("own key z", "string driver:parameters:OpenEXR:comment = 'second'"),
        "c": ("rgb", 'token productName = "c.png"'),
        "d": ("N", "rel camera = </far>"),
        "e": ("key", "int2 resolution = (24, 16)"),
    }
    write(Path("s.usda"), products, other)
    assert rendered("--all-products", "--json") == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["outputs"] for line in lines if line["type"] == "report"] == [
        ["a.exr", "b.exr", "c.png", "e.exr"],
        ["d.exr"],
    ]
    assert parts(Path("a.exr")) == {"rgba": RGBA} | N | Z
    assert parts(Path("b.exr")) == N | {"key": ("key.R", "key.G", "key.B")} | Z
    joint = {name: primray.read_image(f"{name}.exr") for name in ("a",)}
    Path("alone").mkdir()
    for name in "abe":
        assert rendered("--product", name, "--output-dir", "alone") == 0
    for name in "abe":
        assert Path(f"alone/{name}.exr").stat().st_size > 0
        assert parts(Path(f"alone/{name}.exr")) == parts(Path(f"{name}.exr"))
        assert pixels(f"alone/{name}.exr") == pixels(f"{name}.exr")
    assert np.array_equal(joint["a"].pixels, primray.render("s.usda", spp=2, progress=False).pixels)


def pixels(path: str) -> list[bytes]:
    """The numbers of a file's parts."""
    import OpenImageIO as oiio

    file, found = oiio.ImageInput.open(path), list[bytes]()
    assert file is not None
    while file.seek_subimage(len(found), 0):
        found.append(np.asarray(file.read_image(len(found), 0, 0, file.spec().nchannels, oiio.UNKNOWN)).tobytes())
    file.close()
    return found


def test_frames_are_complete_one_after_another(capsys: pytest.CaptureFixture[str]) -> None:
    write(Path("s.usda"), {"a": ("rgba", 'token productName = "one/a.$F4.exr"'), "b": ("z", "rel camera = </far>")})
    assert rendered("--all-products", "--frames", "1:2", "--json", "--output-dir", "out") == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    written = [line["outputs"][0] for line in lines if line["type"] == "report"]
    assert written == ["out/one/a.0001.exr", "out/b.0001.exr", "out/one/a.0002.exr", "out/b.0002.exr"]


def test_a_command_of_one_frame_numbers_products_as_one_of_all_does() -> None:
    """Farms run a command a frame: no frame may replace another's file."""
    names = {"a": "x/main.exr", "b": "at.0002.exr", "c": "on.$F2.exr"}
    write(Path("s.usda"), {n: ("rgba", f'token productName = "{name}"') for n, name in names.items()})

    def files(folder: str, *commands: str) -> set[str]:
        for frames in commands:
            assert rendered("--all-products", "--res", "8", "6", "--output-dir", folder, "--frames", frames) == 0
        return {str(path.relative_to(folder)) for path in Path(folder).rglob("*.exr")}

    every = {"x/main.0001.exr", "x/main.0002.exr", "at.0002.0001.exr", "at.0002.exr", "on.01.exr", "on.02.exr"}
    assert files("one-by-one", "1", "2") == files("all", "1:2") == every


def test_products_of_a_still_have_no_number() -> None:
    write(Path("s.usda"), {"a": ("rgba", 'token productName = "x/main.exr"')})
    assert rendered("--all-products", "--res", "8", "6") == 0
    assert [str(path) for path in Path().rglob("*.exr")] == ["x/main.exr"]


def test_warnings_are_counted_by_frames_and_not_by_renders(capsys: pytest.CaptureFixture[str]) -> None:
    write(Path("s.usda"), {"a": ("nothing", ""), "b": ("rgba nothing", "rel camera = </far>")})
    assert rendered("--all-products", "--res", "8", "6", "--frames", "1:2") == 0
    assert [line for line in capsys.readouterr().err.splitlines() if line.endswith("frames")] == [
        "warning: render-var (ignored): in 2 of 2 frames"
    ]
    assert rendered("--all-products", "--res", "8", "6", "--frames", "1") == 0
    assert " frames" not in capsys.readouterr().err


def test_names_say_where_products_are_written(tmp_path: Path) -> None:
    names = {
        "a": "in/two/folders/x.exr",
        "b": str(tmp_path / "at/its/place.exr"),
        "c": "in/./two/../two/folders/X.exr",
        "d": "D:\\\\shots\\\\y.exr",
        "e": "s3://bucket/key/z.exr",
        "f": "../beside.exr",
    }
    write(Path("s.usda"), {n: ("rgba", f'token productName = "{name}"\n rel camera = </near>') for n, name in names.items()})
    made = list(primray.render_products("s.usda", spp=1, resolution=(8, 8), progress=False))
    assert [product.file_name for product, _ in made] == [
        "in/two/folders/x.exr",
        names["b"],
        "in/two/folders/X_2.exr",
        "shots/y.exr",
        "bucket/key/z.exr",
        "../beside.exr",
    ]
    notes = {
        p.path[-1]: [d["message"] for d in image.report["diagnostics"] if d["attribute"] == "productName"] for p, image in made
    }
    assert {name for name, messages in notes.items() if messages} == {"c", "d", "e"}
    assert rendered("--all-products", "--output-dir", "out/new") == 0
    files = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.exr")}
    below = {
        f"out/new/{name}" for name in ("in/two/folders/x.exr", "in/two/folders/X_2.exr", "shots/y.exr", "bucket/key/z.exr")
    }
    assert files == below | {"at/its/place.exr", "out/beside.exr"}


@pytest.mark.parametrize(
    ("first", "second", "flags"),
    [
        ("x.$F4.exr", "x.0002.exr", ["--frames", "2"]),
        ("one/x.exr", "link/x.exr", []),
        ("one/x.exr", "link/X.exr", []),
    ],
)
def test_two_products_never_end_in_one_file(
    first: str, second: str, flags: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("one").mkdir()
    Path("link").symlink_to("one")
    write(Path("s.usda"), {"a": ("rgba", f'token productName = "{first}"'), "b": ("z", f'token productName = "{second}"')})
    assert rendered("--all-products", *flags) == 2
    assert "product-output" in capsys.readouterr().err
    assert not list(Path().rglob("*.exr"))


def test_the_library_fills_in_the_frame() -> None:
    write(Path("s.usda"), {"a": ("z", 'token productName = "f/a.$F4.exr"'), "b": ("rgb", "")})
    made = list(primray.render_products("s.usda", spp=2, time_code=7, progress=False))
    assert [product.file_name for product, _ in made] == ["f/a.0007.exr", "b.0007.exr"]
    assert [str(product.save(image, "out")) for product, image in made] == ["out/f/a.0007.exr", "out/b.0007.exr"]
    assert parts(Path("out/f/a.0007.exr")) == Z
    with pytest.raises(primray.PrimrayError, match="time_code"):
        next(primray.render_products("s.usda", spp=2))


def test_a_denoised_product_opens_denoised_and_compares_as_rendered() -> None:
    pytest.importorskip("pyoidn")
    write(Path("s.usda"), {"a": ("rgba noise z", ""), "b": ("z", "")})
    assert rendered("--all-products", "--denoise") == 0
    assert parts(Path("a.exr")) == {"denoised": RGBA, "rgba": RGBA + STDERR} | Z
    assert next(iter(parts(Path("a.exr")))) == "denoised"
    assert parts(Path("b.exr")) == Z
    image = primray.read_image("a.exr")
    assert np.array_equal(image.pixels, primray.render("s.usda", spp=2, progress=False).pixels)
    assert image.denoised is not None
    assert not np.array_equal(image.denoised.pixels, image.pixels)
    assert list(image.aovs) == ["z"]
    assert list(primray.read_image("a.exr").aovs["z"].channels) == ["z"]


@pytest.mark.parametrize("flags", [[], ["--snapshot", "0.01"]])
def test_a_product_without_the_picture_has_the_renders_header(flags: list[str]) -> None:
    import OpenImageIO as oiio

    write(Path("s.usda"), {"a": ("z", "")})
    assert rendered("--all-products", *flags) == 0
    file = oiio.ImageInput.open("a.exr")
    assert file is not None
    spec = file.spec()
    assert spec.getattribute("primray:settings.spp") == 2
    assert spec.getattribute("primray:source") == "depth"


def test_inspect_lists_outputs_with_their_files(capsys: pytest.CaptureFixture[str]) -> None:
    passes = 'def RenderSettings "other" {\n}\ndef RenderPass "all" { rel renderSource = </Render/settings>\n}\n'
    products = {
        "a": ("rgba N", 'token productName = "beauty/a.$F4.exr"'),
        "b": ("z", 'token productName = "beauty/a.$F4.exr"\n rel camera = </far>'),
    }
    write(Path("s.usda"), products, passes)
    found = primray.inspect("s.usda", time_code=7, render_settings="/Render/settings")["outputs"]
    assert [(s["path"], s["followed"]) for s in found["render_settings"]] == [
        ("/Render/settings", True),
        ("/Render/other", False),
    ]
    assert [(p["path"], p["file"], p["camera"], p["picture"]) for p in found["products"]] == [
        ("/Render/a", "beauty/a.0007.exr", "/near", list(RGBA)),
        ("/Render/b", "beauty/a_2.0007.exr", "/far", []),
    ]
    assert [(v["name"], v["source"]) for v in found["products"][0]["variables"]] == [("rgba", "Ci"), ("N", "N")]
    assert found["render_passes"] == [{"path": "/Render/all", "render_settings": "/Render/settings"}]
    written = [
        p.file_name
        for p, _ in primray.render_products("s.usda", spp=1, time_code=7, progress=False, render_settings="/Render/settings")
    ]
    assert written == [p["file"] for p in found["products"]]
    assert run(["inspect", "s.usda", "--render-settings", "/Render/settings", "--frames", "7"]) == 0
    said = capsys.readouterr().out
    for line in (
        "/Render/a to beauty/a.0007.exr: rgba, N",
        "/Render/other, not followed",
        "/Render/all, from /Render/settings",
    ):
        assert line in said


LOSSY = 'string driver:parameters:OpenEXR:compression = "dwaa"'
MATTE = 'def RenderVar "matte" { string sourceName = "CryptoObject"\n}\n'


def test_inspect_and_render_say_the_same_of_all_products() -> None:
    """Names that are changed, outputs that are left out, and losses: of products that a plain render does not make, too."""
    names = {"a": "a.exr", "b": "b.$F4.rat", "c": "~/c.exr", "d": f"{'d' * 200}.exr", "e": "e?.exr"}
    ordered = {"a": "rgba", "b": "matte", "c": "nothing", "d": "rgba z", "e": "rgba"}
    lossy = {"b", "d"}
    products = {
        name: (ordered[name], f'token productName = "{file}"\n{LOSSY if name in lossy else ""}') for name, file in names.items()
    }
    write(Path("s.usda"), products, MATTE)
    found = primray.inspect("s.usda", time_code=7)["outputs"]["diagnostics"]
    made = [image for _, image in primray.render_products("s.usda", spp=1, resolution=(8, 8), time_code=7, progress=False)]
    rows = [row for image in made for row in image.report["diagnostics"] if row["code"] in ("output-parameter", "render-var")]
    assert sorted({tuple(row.items()) for row in rows}) == sorted({tuple(row.items()) for row in found})
    said = {row["prim_path"][-1]: row["message"] for row in found if row["code"] == "output-parameter" and row["attribute"]}
    assert set(said) == set("bcde")
    for name, words in {"b": ".rat is not supported", "c": "characters", "d": "cut to 180", "e": "characters"}.items():
        assert words in said[name]
    (loss,) = (row for row in found if "lossy" in row["message"])
    assert (loss["prim_path"], "matte" in loss["message"]) == ("/Render/b", True)
    (left_out,) = (row for row in found if row["code"] == "render-var")
    assert "crypto_object, crypto_material, crypto_asset" in left_out["message"]


def test_inspect_names_products_that_would_be_one_file(capsys: pytest.CaptureFixture[str]) -> None:
    products = {"a": ("rgba", 'token productName = "x.$F4.exr"'), "b": ("z", 'token productName = "x.0002.exr"')}
    write(Path("s.usda"), products)
    assert run(["inspect", "s.usda", "--frames", "2"]) == 0
    inspected = capsys.readouterr().out
    assert rendered("--all-products", "--frames", "2") == 2
    for said in (inspected, capsys.readouterr().err):
        assert "the products /Render/a and /Render/b would be written to one file" in said


@pytest.mark.parametrize(
    ("source", "hint"),
    [
        ("cryptomatte", "Cryptomattes are crypto_object, crypto_material, crypto_asset"),
        ("RI_Cryptomattes", "Cryptomattes are"),
        ("dpeth", "did you mean depth?"),
        ("normall", "did you mean normal?"),
        ("xyzzy", "named xyzzy;"),
    ],
)
def test_an_output_that_there_is_not_gets_a_hint(source: str, hint: str) -> None:
    write(Path("s.usda"), {"a": ("rgba other", "")}, f'def RenderVar "other" {{ string sourceName = "{source}"\n}}\n')
    (row,) = (row for row in primray.inspect("s.usda")["outputs"]["diagnostics"] if row["code"] == "render-var")
    assert hint in row["message"]
    assert "crypto_asset and primvars" in row["message"]


def test_products_of_a_frame_in_parts_are_the_same(tmp_path: Path) -> None:
    from primray.render.prepare import open_once
    from primray.render.products import products_of, renders_of

    write(Path("s.usda"), {"a": ("rgba N", ""), "b": ("z key noise", "")})
    settings = primray.RenderSettings(spp=4, resolution=(24, 16))
    ((joint, made),) = renders_of(products_of(open_once("s.usda", settings), settings))
    whole = primray.render("s.usda", joint, progress=False)
    apart = primray.render("s.usda", joint, progress=False, executor=primray.LocalProcesses(2))
    assert apart.file == whole.file
    for product in made:
        files = [str(tmp_path / f"{name}.exr") for name in ("whole", "apart")]
        for image, file in zip((whole, apart), files, strict=True):
            product.image_of(image).save(file)
        assert parts(Path(files[0])) == parts(Path(files[1]))
        assert pixels(files[0]) == pixels(files[1])


@pytest.mark.parametrize(("light", "background", "channels"), [("DomeLight", "light", 3), ("DistantLight", "nothing", 4)])
@pytest.mark.parametrize("flags", [["--all-products"], ["--product", "a", "--product", "c"], ["--product", "c"]])
def test_products_know_what_is_behind_the_picture(light: str, background: str, channels: int, flags: list[str]) -> None:
    import OpenImageIO as oiio

    write(Path("s.usda"), {"a": ("rgba z", ""), "b": ("z", ""), "c": ("rgba", 'token productName = "c.png"')})
    Path("s.usda").write_text(Path("s.usda").read_text().replace("DomeLight", light))
    assert rendered(*flags) == 0
    for path in Path().glob("*.exr"):
        assert oiio.ImageBuf(str(path)).spec().getattribute("primray:background") == background
    assert oiio.ImageBuf("c.png").spec().nchannels == channels
    for product, image in primray.render_products("s.usda", spp=2, progress=False):
        product.save(image, "by-library")
    assert oiio.ImageBuf("by-library/c.png").spec().nchannels == channels
