"""Inputs that were files once: usda, usdc, usdz, zip, PNG and EXR, damaged in ways that parsers dislike. From a seed, always
the same; the bases are made here, nothing is downloaded.

    python -m tests.service.threats.fuzz_corpus FOLDER [COUNT] [SEED]     writes them out, to look at one that broke something
"""

from __future__ import annotations

import random
import re
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tests.service.scenes.zips import Entry, zip_of
from tests.service.threats.fates import ROOM, usda

KINDS = ("usda", "usdc", "usdz", "zip", "png", "exr")
TEXTURED = """
def Mesh "floor" (prepend apiSchemas = ["MaterialBindingAPI"]) {
int[] faceVertexCounts = [4, 3]
int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 2]
point3f[] points = [(-3, -1, -3), (-3, -1, 3), (3, -1, 3), (3, -1, -3)]
texCoord2f[] primvars:st = [(0, 0), (0, 1), (1, 1), (1, 0)] (interpolation = "vertex")
rel material:binding = </M>
}
def Material "M" {
token outputs:surface.connect = </M/S.outputs:surface>
def Shader "S" {
uniform token info:id = "UsdPreviewSurface"
color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
float inputs:roughness.timeSamples = { 0: 0.1, 10: 0.9 }
token outputs:surface
}
def Shader "T" {
uniform token info:id = "UsdUVTexture"
asset inputs:file = @tex/a.IMAGE@
float3 outputs:rgb
}
}
def DomeLight "sky" { asset inputs:texture:file = @tex/a.IMAGE@ }
def "R" (references = </floor>; variants = { string v = "a" }; prepend variantSets = "v") {
variantSet "v" = { "a" { double x = 1 } "b" (payload = @part.usda@</P>) {} }
}
def PointInstancer "many" {
rel prototypes = </many/s>
int[] protoIndices = [0, 0, 0]
point3f[] positions = [(0, 0, 0), (1, 2, 3), (2, 0, 0)]
def Sphere "s" { double radius = 0.2 }
}
def BasisCurves "c" { int[] curveVertexCounts = [4]
point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 1, 0), (3, 1, 1)] }
"""
SECRET_PATHS = ("/etc/passwd", "../../../secret.usda", "/proc/self/environ", "/dev/zero", "http://169.254.169.254/x.usda")
HUGE = ("1e308", "-1e308", "nan", "inf", "99999999999999999999", "-2147483649", "4294967296", "1e-320", "2147483647")


@dataclass(frozen=True)
class Input:
    number: int
    kind: str  # of what was damaged
    mutation: str
    data: bytes  # to be uploaded

    @property
    def name(self) -> str:
        return f"{self.number:05d}-{self.mutation}.{'zip' if self.kind in ('png', 'exr') else self.kind}"


def corpus(count: int, seed: int = 1) -> Iterator[Input]:
    """Every kind as often as every other, by turns."""
    bases = _bases()
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        kind = KINDS[number % len(KINDS)]
        mutations = [*BINARY.items(), *(TEXT.items() if kind == "usda" else ())]
        name, mutate = mutations[rng.randrange(len(mutations))]
        damaged = mutate(bases[kind], rng)
        if rng.random() < 0.2:
            second, again = mutations[rng.randrange(len(mutations))]
            damaged, name = again(damaged, rng), f"{name}+{second}"
        yield Input(number, kind, name, _packed(kind, damaged) if kind in ("png", "exr") else damaged)


def _bases() -> dict[str, bytes]:
    layer = usda(ROOM + TEXTURED.replace("IMAGE", "png"), 'defaultPrim = "floor"').encode()
    part = usda('def Xform "P" { def Cube "c" {} }').encode()
    png, exr = _image("png"), _image("exr")
    members = [("shot.usda", layer), ("part.usda", part), ("tex/a.png", png)]
    return {
        "usda": layer,
        "usdc": _crate(layer),
        "usdz": zip_of(*(Entry(name, data, align=True) for name, data in [("shot.usdc", _crate(layer)), *members[1:]])),
        "zip": zip_of(*(Entry(name, data, deflate=True) for name, data in members)),
        "png": png,
        "exr": exr,
    }


def _packed(kind: str, image: bytes) -> bytes:
    layer = usda(ROOM + TEXTURED.replace("IMAGE", kind)).encode()
    return zip_of(Entry("shot.usda", layer), Entry(f"tex/a.{kind}", image))


def _crate(layer: bytes) -> bytes:
    from pxr import Sdf

    with tempfile.TemporaryDirectory() as folder:
        made = Sdf.Layer.CreateAnonymous(".usda")
        assert made.ImportFromString(layer.decode())
        made.Export(f"{folder}/a.usdc")
        return Path(folder, "a.usdc").read_bytes()


def _image(kind: str) -> bytes:
    import OpenImageIO as oiio

    pixels = np.random.default_rng(5).random((16, 24, 3), np.float32)
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/a.{kind}"
        spec = oiio.ImageSpec(24, 16, 3, "uint8" if kind == "png" else "half")
        spec.attribute("DateTime", "2026:01:01 00:00:00")  # else it is that of now, and no two corpora are the same
        file = oiio.ImageOutput.create(path)
        assert file is not None
        file.open(path, spec)
        file.write_image(pixels)
        file.close()
        return Path(path).read_bytes()


def _flip_bits(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 2, 8, 64))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def _flip_bits_in_front(data: bytes, rng: random.Random) -> bytes:
    """Where headers are."""
    front = min(len(data), 128)
    return _flip_bits(data[:front], rng) + data[front:]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(1, len(data))]


def _cut_out(data: bytes, rng: random.Random) -> bytes:
    begin = rng.randrange(len(data))
    return data[:begin] + data[begin + rng.choice((1, 4, 16, 256, 4096)) :] or b"x"


def _splice(data: bytes, rng: random.Random) -> bytes:
    """A piece of it somewhere else in it."""
    begin = rng.randrange(len(data))
    piece = data[begin : begin + rng.choice((4, 16, 64, 1024))]
    at = rng.randrange(len(data))
    return data[:at] + piece + (data[at:] if rng.random() < 0.5 else data[at + len(piece) :])


def _repeat(data: bytes, rng: random.Random) -> bytes:
    begin = rng.randrange(len(data))
    piece = data[begin : begin + rng.choice((1, 8, 64))]
    return data[:begin] + piece * rng.choice((10, 1000, 20_000)) + data[begin:]


def _length_field(data: bytes, rng: random.Random) -> bytes:
    """A word that may be a count, a size or a place becomes one that nothing is that large."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 3))):
        order, (form, size) = rng.choice("<>"), rng.choice((("H", 2), ("I", 4), ("Q", 8)))
        if len(out) > size:
            at = rng.randrange(len(out) - size)
            value = rng.choice((0, 1, 2 ** (8 * size) - 1, 2 ** (8 * size - 1), 2 ** (8 * size - 1) - 1, len(data)))
            out[at : at + size] = struct.pack(order + form, value)
    return bytes(out)


def _noise(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.choice((4, 64, 2048))) + data[at:]


def _huge_number(data: bytes, rng: random.Random) -> bytes:
    numbers = list(re.finditer(rb"(?<![\w.])-?\d+(\.\d+)?", data))
    for match in sorted(rng.sample(numbers, min(len(numbers), rng.choice((1, 3, 10)))), key=lambda m: -m.start()):
        data = data[: match.start()] + rng.choice(HUGE).encode() + data[match.end() :]
    return data


def _nest(data: bytes, rng: random.Random) -> bytes:
    opening, closing = rng.choice(((b"[", b"]"), (b"(", b")"), (b'def "n" {\n', b"}\n"), (b"{ dictionary d = ", b"}\n")))
    depth, at = rng.choice((10, 1500, 30_000)), rng.randrange(len(data))
    return data[:at] + opening * depth + closing * depth + data[at:]


def _asset_path(data: bytes, rng: random.Random) -> bytes:
    paths = list(re.finditer(rb"@[^@\n]*@", data))
    if not paths:
        return _flip_bits(data, rng)
    match = rng.choice(paths)
    return data[: match.start()] + f"@{rng.choice(SECRET_PATHS)}@".encode() + data[match.end() :]


def _swap_words(data: bytes, rng: random.Random) -> bytes:
    words = list(re.finditer(rb"[A-Za-z:]{2,}", data))
    if len(words) < 2:
        return _flip_bits(data, rng)
    first, second = sorted(rng.sample(words, 2), key=lambda m: m.start())
    between = data[first.end() : second.start()]
    return data[: first.start()] + second.group() + between + first.group() + data[second.end() :]


Mutation = Callable[[bytes, random.Random], bytes]
BINARY: dict[str, Mutation] = {
    "bits": _flip_bits,
    "bits-in-front": _flip_bits_in_front,
    "cut": _cut,
    "cut-out": _cut_out,
    "splice": _splice,
    "repeat": _repeat,
    "length": _length_field,
    "noise": _noise,
}
TEXT: dict[str, Mutation] = {"huge": _huge_number, "nest": _nest, "asset": _asset_path, "swap": _swap_words}


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    for made in corpus(*(int(text) for text in sys.argv[2:4] or ["2000"])):
        (target / made.name).write_bytes(made.data)
