"""What the page reads of an EXR is what OpenImageIO reads, number by number."""

from __future__ import annotations

import base64
import re
from itertools import pairwise
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

READ = """async (text) => {
  const { openExr } = await import("/page/exr/file.js");
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const asked = [];
  try {
    const file = await openExr(async (begin, end) => (asked.push([begin, end]), bytes.slice(begin, end)), bytes.byteLength);
    const found = [];
    for (const [number, part] of file.parts.entries()) {
      const { step, width, height, planes } = await file.planes(number);
      const numbers = planes.map((plane) => [...plane].map((value) => (Number.isFinite(value) ? value : String(value))));
      const window = [part.x, part.y, part.frame.width];
      found.push({ name: part.name, channels: part.channels, step, width, height, window, planes: numbers });
    }
    return { parts: found, asked };
  } catch (failure) {
    return { failure: failure.constructor.name, message: failure.message };
  }
}"""
RANDOM = np.random.default_rng(7)


@pytest.fixture(scope="module")
def page(browser, site):
    found = browser.new_context().new_page()
    found.goto(site.url)
    yield found
    found.context.close()


def read(page, path):
    return page.evaluate(READ, base64.b64encode(path.read_bytes()).decode())


def spec_of(kind, width, height, channels, compression, name=""):
    spec = oiio.ImageSpec(width, height, len(channels), kind)
    spec.channelnames = channels
    spec.attribute("compression", compression)
    if name:
        spec.attribute("oiio:subimagename", name)
    return spec


def write(path, parts):
    out: Any = oiio.ImageOutput.create(str(path))
    specs = [spec for spec, _ in parts]
    assert out.open(str(path), specs) if len(specs) > 1 else out.open(str(path), specs[0])
    for number, (spec, values) in enumerate(parts):
        assert number == 0 or out.open(str(path), spec, "AppendSubimage")
        assert out.write_image(values)
    assert out.close()


def planes_of(part):
    order = np.argsort([channel["name"] for channel in part["channels"]], kind="stable")
    assert list(order) == list(range(len(order)))  # a file has them by name
    return {
        channel["name"]: np.array([float(v) for v in plane], np.float64).reshape(part["height"], part["width"])
        for channel, plane in zip(part["channels"], part["planes"], strict=True)
    }


@pytest.mark.parametrize("compression", ["zip", "zips", "none"])
def test_a_single_part_of_any_type(page, tmp_path, compression):
    values = RANDOM.normal(size=(37, 23, 4)).astype(np.float32)
    values[3, 5] = (np.inf, -np.inf, np.nan, 0)
    for kind in (oiio.FLOAT, oiio.HALF):
        spec = spec_of(kind, 23, 37, ("R", "G", "B", "A"), compression)
        spec.x, spec.y, spec.full_width, spec.full_height = 4, 9, 100, 80
        write(tmp_path / "one.exr", [(spec, values)])
        (part,) = read(page, tmp_path / "one.exr")["parts"]
        assert (part["width"], part["height"], part["step"], part["window"]) == (23, 37, 1, [4, 9, 100])
        expected = values if kind == oiio.FLOAT else values.astype(np.float16)
        for number, name in enumerate("RGBA"):
            assert np.array_equal(planes_of(part)[name], expected[..., number], equal_nan=True)


def test_each_part_is_read_by_its_own_bytes(page, tmp_path):
    ids = RANDOM.integers(0, 2**32, size=(90, 70, 1), dtype=np.uint32)
    color = RANDOM.normal(size=(90, 70, 3)).astype(np.float32)
    parts = [
        (spec_of(oiio.FLOAT, 70, 90, ("R", "G", "B"), "zip", "rgba"), color),
        (spec_of(oiio.UINT32, 70, 90, ("prim",), "zip", "prim"), ids),
        (spec_of(oiio.FLOAT, 70, 90, ("far",), "zip", "far"), np.zeros((90, 70, 1), np.float32)),
    ]
    write(tmp_path / "many.exr", parts)
    found = read(page, tmp_path / "many.exr")
    assert [part["name"] for part in found["parts"]] == ["rgba", "prim", "far"]
    assert np.array_equal(planes_of(found["parts"][1])["prim"], ids[..., 0])
    assert np.array_equal(planes_of(found["parts"][0])["G"], color[..., 1])
    assert not planes_of(found["parts"][2])["far"].any()
    ranges = found["asked"][-3:]
    assert all(a[1] <= b[0] for a, b in pairwise(ranges))  # none is fetched twice


def test_what_is_no_such_file_is_said(page, tmp_path):
    (tmp_path / "not.exr").write_bytes(b"PNG" * 100)
    assert "no OpenEXR" in read(page, tmp_path / "not.exr")["message"]
    spec = spec_of(oiio.FLOAT, 64, 64, ("Z",), "zip")
    write(tmp_path / "whole.exr", [(spec, RANDOM.normal(size=(64, 64, 1)).astype(np.float32))])
    data = (tmp_path / "whole.exr").read_bytes()
    for at in (0.02, 0.5, 0.9):
        (tmp_path / "cut.exr").write_bytes(data[: int(at * len(data))])
        assert "failure" in read(page, tmp_path / "cut.exr")
    write(tmp_path / "other.exr", [(spec_of(oiio.FLOAT, 8, 8, ("Z",), "piz"), np.zeros((8, 8, 1), np.float32))])
    assert re.search("Compression number 4", read(page, tmp_path / "other.exr")["message"])
