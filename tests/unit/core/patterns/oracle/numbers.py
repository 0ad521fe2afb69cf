"""Numbers, vectors, colours, conditions and channels."""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.float64]
Inputs = Mapping[str, Rows]


def quotient(a: Rows, b: Rows) -> Rows:
    """0 where it has no value."""
    a, b = np.broadcast_arrays(a, b)
    return np.divide(a, b, out=np.zeros(a.shape), where=b != 0)


def mixed(i: Inputs, result: Rows) -> Rows:
    return i["mix"] * result + (1 - i["mix"]) * i["bg"]


def power(a: Rows, b: Rows) -> Rows:
    with np.errstate(all="ignore"):
        return np.nan_to_num(np.power(a, b), nan=0.0)


def burn(i: Inputs) -> Rows:
    return np.where(np.abs(i["fg"]) < 1e-8, 0, mixed(i, 1 - quotient(1 - i["bg"], i["fg"])))


def dodge(i: Inputs) -> Rows:
    return np.where(np.abs(1 - i["fg"]) < 1e-8, 0, mixed(i, quotient(i["bg"], 1 - i["fg"])))


def alpha(i: Inputs, name: str) -> Rows:
    return i[name][:, 3:]


def disjoint_over(i: Inputs) -> Rows:
    fa, ba = alpha(i, "fg"), alpha(i, "bg")
    scaled = i["fg"] + i["bg"] * quotient(1 - fa, ba)
    color = np.where(fa + ba <= 1, i["fg"] + i["bg"], np.where(np.abs(ba) < 1e-8, 0, scaled))[:, :3]
    return mixed(i, np.hstack([color, np.minimum(fa + ba, 1)]))


def smoothstep(i: Inputs) -> Rows:
    t = np.clip(quotient(i["in"] - i["low"], i["high"] - i["low"]), 0, 1)
    return np.where(i["in"] >= i["high"], 1.0, np.where(i["in"] <= i["low"], 0.0, t * t * (3 - 2 * t)))


def by_row(f: Callable[[float, float, float], tuple[float, float, float]]) -> Callable[[Inputs], Rows]:
    def apply(i: Inputs) -> Rows:
        return np.hstack([np.array([f(*row) for row in i["in"][:, :3]]), i["in"][:, 3:]])

    return apply


def rotate2d(i: Inputs) -> Rows:
    angle = np.radians(i["amount"][:, 0])
    x, y = i["in"].T
    return np.stack([np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x], axis=1)


def rotate3d(i: Inputs) -> Rows:
    """By the matrix of the rotation, transposed: vectors are rows, and stand before it."""
    out = []
    for v, degrees, axis in zip(i["in"], i["amount"][:, 0], i["axis"], strict=True):
        x, y, z = axis / np.linalg.norm(axis)
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        a = np.radians(degrees)
        m = np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * k @ k
        out.append(v @ m)
    return np.array(out)


def luminance(i: Inputs) -> Rows:
    grey = (i["in"][:, :3] * i["lumacoeffs"]).sum(axis=1, keepdims=True)
    return np.hstack([grey, grey, grey, i["in"][:, 3:]])


def extract(i: Inputs) -> Rows:
    width = i["in"].shape[1]
    rows = i["in"].reshape(len(i["in"]), *{9: (3, 3), 16: (4, 4)}.get(width, (width, 1)))
    return rows[np.arange(len(rows)), np.clip(i["index"][:, 0].astype(int), 0, rows.shape[1] - 1)]


def chosen(i: Inputs, condition: npt.NDArray[np.bool_]) -> Rows:
    return np.where(condition, i["in1"], i["in2"]) if "in1" in i else condition.astype(float)


def normalmap(i: Inputs) -> Rows:
    coded = np.where((i["in"] == 0).all(axis=1, keepdims=True), [0.5, 0.5, 1.0], i["in"]) * 2 - 1
    scale = np.broadcast_to(i["scale"], (len(coded), 2))
    n = i["tangent"] * coded[:, :1] * scale[:, :1] + i["bitangent"] * coded[:, 1:2] * scale[:, 1:] + i["normal"] * coded[:, 2:]
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def ramp(low: str, high: str, axis: int) -> Callable[[Inputs], Rows]:
    def apply(i: Inputs) -> Rows:
        t = np.clip(i["texcoord"][:, axis : axis + 1], 0, 1)
        return i[low] * (1 - t) + i[high] * t

    return apply


def split(low: str, high: str, axis: int) -> Callable[[Inputs], Rows]:
    return lambda i: np.where(i["texcoord"][:, axis : axis + 1] >= i["center"], i[high], i[low])


def length(v: Rows) -> Rows:
    return np.linalg.norm(v, axis=1, keepdims=True)


def side_by_side(i: Inputs) -> Rows:
    return np.hstack([i[name] for name in ("in1", "in2", "in3", "in4") if name in i])


NUMBERS: dict[str, Callable[[Inputs], Rows]] = {
    "add": lambda i: i["in1"] + i["in2"],
    "subtract": lambda i: i["in1"] - i["in2"],
    "modulo": lambda i: np.mod(i["in1"], i["in2"]),
    "fract": lambda i: np.mod(i["in"], 1),
    "invert": lambda i: i["amount"] - i["in"],
    "absval": lambda i: np.abs(i["in"]),
    "sign": lambda i: np.sign(i["in"]),
    "floor": lambda i: np.floor(i["in"]),
    "ceil": lambda i: np.ceil(i["in"]),
    "round": lambda i: np.floor(i["in"] + 0.5),
    "power": lambda i: power(i["in1"], i["in2"]),
    "sin": lambda i: np.sin(i["in"]),
    "cos": lambda i: np.cos(i["in"]),
    "tan": lambda i: np.tan(i["in"]),
    "asin": lambda i: np.arcsin(np.clip(i["in"], -1, 1)),
    "acos": lambda i: np.arccos(np.clip(i["in"], -1, 1)),
    "atan2": lambda i: np.arctan2(i["iny"], i["inx"]),
    "sqrt": lambda i: np.sqrt(np.maximum(i["in"], 0)),
    "ln": lambda i: np.log(np.maximum(i["in"], 2.0**-126)),
    "exp": lambda i: np.exp(i["in"]),
    "clamp": lambda i: np.minimum(np.maximum(i["in"], i["low"]), i["high"]),
    "min": lambda i: np.minimum(i["in1"], i["in2"]),
    "max": lambda i: np.maximum(i["in1"], i["in2"]),
    "normalize": lambda i: quotient(i["in"], length(i["in"])),
    "magnitude": lambda i: length(i["in"]),
    "dotproduct": lambda i: (i["in1"] * i["in2"]).sum(axis=1, keepdims=True),
    "crossproduct": lambda i: np.cross(i["in1"], i["in2"]),
    "rotate2d": rotate2d,
    "rotate3d": rotate3d,
    "remap": lambda i: i["outlow"] + quotient((i["in"] - i["inlow"]) * (i["outhigh"] - i["outlow"]), i["inhigh"] - i["inlow"]),
    "smoothstep": smoothstep,
    "luminance": luminance,
    "rgbtohsv": by_row(colorsys.rgb_to_hsv),
    "hsvtorgb": by_row(colorsys.hsv_to_rgb),
    "mix": lambda i: mixed(i, i["fg"]),
    "plus": lambda i: mixed(i, i["bg"] + i["fg"]),
    "minus": lambda i: mixed(i, i["bg"] - i["fg"]),
    "difference": lambda i: mixed(i, np.abs(i["bg"] - i["fg"])),
    "screen": lambda i: mixed(i, 1 - (1 - i["fg"]) * (1 - i["bg"])),
    "burn": burn,
    "dodge": dodge,
    "over": lambda i: mixed(i, i["fg"] + i["bg"] * (1 - alpha(i, "fg"))),
    "in": lambda i: mixed(i, i["fg"] * alpha(i, "bg")),
    "out": lambda i: mixed(i, i["fg"] * (1 - alpha(i, "bg"))),
    "mask": lambda i: mixed(i, i["bg"] * alpha(i, "fg")),
    "matte": lambda i: mixed(i, np.hstack([i["fg"][:, :3] * alpha(i, "fg"), alpha(i, "fg")]) + i["bg"] * (1 - alpha(i, "fg"))),
    "disjointover": disjoint_over,
    "inside": lambda i: i["in"] * i["mask"],
    "outside": lambda i: i["in"] * (1 - i["mask"]),
    "premult": lambda i: np.hstack([i["in"][:, :3] * i["in"][:, 3:], i["in"][:, 3:]]),
    "unpremult": lambda i: np.hstack([quotient(i["in"][:, :3], i["in"][:, 3:]), i["in"][:, 3:]]),
    "ifgreater": lambda i: chosen(i, i["value1"] > i["value2"]),
    "ifgreatereq": lambda i: chosen(i, i["value1"] >= i["value2"]),
    "ifequal": lambda i: chosen(i, i["value1"] == i["value2"]),
    "and": lambda i: i["in1"] * i["in2"],
    "or": lambda i: np.maximum(i["in1"], i["in2"]),
    "not": lambda i: 1 - i["in"],
    "convert": lambda i: i["in"],
    "dot": lambda i: i["in"],
    "constant": lambda i: i["value"],
    "combine2": side_by_side,
    "combine3": side_by_side,
    "combine4": side_by_side,
    "extract": extract,
    "normalmap": normalmap,
    "ramplr": ramp("valuel", "valuer", 0),
    "ramptb": ramp("valueb", "valuet", 1),
    "splitlr": split("valuel", "valuer", 0),
    "splittb": split("valueb", "valuet", 1),
}
