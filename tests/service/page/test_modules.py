"""The page's modules by themselves, in the browser that runs them."""

from __future__ import annotations

import base64
import io
import re
import zipfile
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import primray_service
from primray.color.color_space import ACESCG, REC709, linear_spaces
from primray.color.ocio import is_rendering_space, to_display
from primray.file_formats import SUFFIXES
from primray_service.pictures.request import Space
from primray_service.worker.preview import preview_of, write_preview


@pytest.fixture(scope="module")
def page(browser, site):
    """One for all of them: they leave nothing behind."""
    context = browser.new_context()
    found = context.new_page()
    found.goto(site.url)
    yield found
    context.close()


def test_zips_hold_the_files_and_are_the_same_each_time(page):
    script = """async () => {
      const { stored } = await import("/page/scene/zip.js");
      const entries = [
        { path: "scene.usda", file: new File(["#usda 1.0\\n"], "scene.usda") },
        { path: "tex/grün ☂.png", file: new File([new Uint8Array(300000).map((_, i) => i * 7)], "x.png") },
        { path: "empty", file: new File([], "empty") },
      ];
      const seen = [];
      const blobs = [await stored(entries, (done) => seen.push(done)), await stored(entries)];
      const texts = [];
      for (const blob of blobs) {
        const bytes = new Uint8Array(await blob.arrayBuffer());
        let text = "";
        for (const byte of bytes) text += String.fromCharCode(byte);
        texts.push(btoa(text));
      }
      return [texts, seen.at(-1)];
    }"""
    (first, second), seen = page.evaluate(script)
    assert first == second
    assert seen == 300010
    package = zipfile.ZipFile(io.BytesIO(base64.b64decode(first)))
    assert package.testzip() is None
    assert package.namelist() == ["scene.usda", "tex/grün ☂.png", "empty"]
    assert package.read("tex/grün ☂.png") == bytes(i * 7 % 256 for i in range(300000))
    assert {info.compress_type for info in package.infolist()} == {zipfile.ZIP_STORED}


@pytest.mark.parametrize(
    ("paths", "name", "members"),
    [
        (["shot.usda"], "shot.usda", None),
        (["shot/shot.usda", "shot/tex/a.png", "shot/.DS_Store"], "shot.zip", ["shot.usda", "tex/a.png"]),
        (["b.usda", "a.png"], "b.zip", ["a.png", "b.usda"]),
        (["one/a.usd", "two/b.png"], "one/a.zip", ["one/a.usd", "two/b.png"]),
        (["car.GLB"], "car.GLB", None),
        (["car/tex.png", "car/car.gltf"], "car.gltf", None),
    ],
)
def test_what_is_dropped_becomes_one_file(page, paths, name, members):
    script = """async (paths) => {
      const { packed } = await import("/page/scene/dropped.js");
      const files = paths.map((path) => ({ path, file: new File(["x"], path.split("/").at(-1)) }));
      const { name, blob, notes } = await packed(files, () => {});
      return [name, [...new Uint8Array(await blob.arrayBuffer())], notes];
    }"""
    found, content, notes = page.evaluate(script, paths)
    assert found == name
    if members is not None:
        assert zipfile.ZipFile(io.BytesIO(bytes(content))).namelist() == members
    assert notes == (["Left out: shot/.DS_Store"] if "shot/.DS_Store" in paths else [])


def test_formats_that_the_server_advises_on_are_those_that_are_sent_to_it():
    text = (Path(primray_service.__file__).parent / "page/scene/dropped.js").read_text()
    (names,) = re.findall(r"OTHER = /\\\.\(([\w|]+)\)\$/i", text)
    assert tuple(f".{name}" for name in names.split("|")) == SUFFIXES


@pytest.mark.parametrize(
    ("paths", "sentence"),
    [
        ([], "Nothing that was dropped is a file"),
        (["a.png", "b.txt"], "None of these files is a USD layer"),
        ([".DS_Store"], "Nothing that was dropped is a file"),
    ],
)
def test_what_cannot_be_rendered_is_said(page, paths, sentence):
    script = """async (paths) => {
      const { packed } = await import("/page/scene/dropped.js");
      const files = paths.map((path) => ({ path, file: new File(["x"], path) }));
      return packed(files, () => {}).then(() => "", (error) => error.message);
    }"""
    assert sentence in page.evaluate(script, paths)


@pytest.fixture
def preview(tmp_path):
    """Values of every kind that a picture can have, as a worker writes them."""
    pixels = np.random.default_rng(1).gamma(0.4, size=(37, 53, 4)).astype(np.float32)
    pixels[0, 0] = (0.0, 65504.0, -0.25, 1.0)
    pixels[0, 1] = (6.0e-8, 6.1e-5, 1.0, 1.0)
    errors = np.full((37, 53, 3), 0.01, np.float32)
    errors[0, 0] = np.inf
    written = preview_of(pixels, errors, 3, 12)
    name, _ = write_preview(written, tmp_path)
    return written, (tmp_path / name).read_bytes()


def test_half_floats_are_read_bit_by_bit(page, preview):
    written, data = preview
    script = """async (text) => {
      const { decodeRaw } = await import("/page/picture/raw_image.js");
      const { encoded } = await import("/page/base/srgb.js");
      const { wordsAt } = await import("/page/layers/values.js");
      const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      const raw = decodeRaw(bytes.buffer);
      const values = raw.planes.slice(0, 3).map((plane) => [...plane]);
      const levels = Array.from({ length: 1000 }, (_, i) => encoded(i / 990));
      return [raw.width, raw.height, values, wordsAt(raw, 0, 0).numbers, levels];
    }"""
    width, height, values, words, levels = page.evaluate(script, base64.b64encode(data).decode())
    assert (width, height) == (53, 37)
    assert np.array_equal(np.float32(values).reshape(3, 37, 53), np.moveaxis(written.rgb, -1, 0))
    assert words == "R 0.0000  G 6.6·10⁴  B -0.2500  A 1.0000  ± ?"
    linear = np.clip(np.arange(1000) / 990, 0, 1)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055) * 255
    assert np.abs(np.array(levels) - expected).max() <= 0.5 + 1e-6


def test_a_damaged_preview_is_refused(page, preview):
    _, data = preview
    script = """async (text) => {
      const { decodeRaw } = await import("/page/picture/raw_image.js");
      try {
        decodeRaw(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
        return "";
      } catch (error) {
        return error.message;
      }
    }"""
    assert "ended early" in page.evaluate(script, base64.b64encode(data[:-2]).decode())
    assert "version" in page.evaluate(script, base64.b64encode(b"x" + data[1:]).decode())
    assert "version" in page.evaluate(script, "")


def test_the_view_is_that_of_the_servers_pictures(page):
    """From its table, of colours as pictures have them, of strongly saturated ones and of very bright ones; of any space."""
    random = np.random.default_rng(5)
    light = 2.0 ** random.uniform(-9, 5, (4000, 1))
    plain = light * random.uniform(0.3, 1, (4000, 3))
    saturated = light * np.where(random.random((4000, 3)) < 0.3, 0, random.random((4000, 3)) ** 2)
    odd = np.array([[0, 0, 0], [1e6, 1e6, 1e6], [512, 512, 512]], np.float64)
    rgb = np.concatenate([plain, saturated, odd]).astype(np.float32)
    script = """async ([values, space]) => {
      const { serversView } = await import("/page/layers/display.js");
      const view = await serversView(space);
      return view && values.map((rgb) => {
        const data = new Uint8ClampedArray(4);
        view.shade(data, 0, ...rgb);
        return [...data.slice(0, 3)];
      });
    }"""
    for space in (REC709, ACESCG):
        expected = np.round(255 * np.clip(to_display(rgb[None], space=space)[0], 0, 1))
        apart = np.abs(np.array(page.evaluate(script, [rgb.tolist(), space.name])) - expected).max(axis=1)
        assert apart[:4000].max() <= 3
        assert (apart[:4000] > 1).mean() < 0.01
        assert (apart[4000:8000] > 2).mean() < 0.03
        assert apart[8000:].max() <= 1
    assert page.evaluate(script, [[], "data"]) is None


def test_the_page_knows_the_spaces_that_pictures_can_be_in(page):
    known = page.evaluate("async () => (await import('/page/layers/display.js')).SPACES")
    assert known == list(get_args(Space)) == [space.name for space in linear_spaces() if is_rendering_space(space)]


@pytest.mark.parametrize(
    ("function", "value", "text"),
    [
        ("bytes", 0, "0 bytes"),
        ("bytes", 999_600, "1.0 MB"),
        ("bytes", 12_345_678, "12.3 MB"),
        ("duration", 0.04, "0.04 s"),
        ("duration", 59.7, "60 s"),
        ("duration", 61, "1 min 1 s"),
        ("duration", 7260, "2 h 1 min"),
        ("error", 0.0213, "0.021"),
        ("error", 0.1, "0.1"),
        ("error", 1, "1"),
        ("error", 3.44e-5, "3.4·10⁻⁵"),
        ("error", 8, "8"),
        ("error", 120, "120"),
        ("error", None, "–"),
        ("count", 518400, "518,400"),
        ("rate", 21_400_000, "21 M/s"),
        ("percent", 0.999, "99 %"),
    ],
)
def test_numbers_read_well(page, function, value, text):
    found = page.evaluate("async ([name, value]) => (await import('/page/base/format.js'))[name](value)", [function, value])
    assert found == text


def test_attributes_that_run_something_are_refused(page):
    script = """async (name) => {
      const { element } = await import("/page/base/dom.js");
      try {
        element("div", { [name]: "alert(1)" });
        return "";
      } catch (error) {
        return error.message;
      }
    }"""
    for name in ("onclick", "style", "srcdoc", "ONERROR"):
        assert "not set by data" in page.evaluate(script, name)
