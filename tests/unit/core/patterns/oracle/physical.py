"""Functions of MaterialX's PBR library that are no closures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .numbers import Inputs, Rows


def blackbody(i: Inputs) -> Rows:
    """Kang et al. 2002, through XYZ of luminance 1 to Rec.709."""
    kelvin = np.clip(i["temperature"][:, 0], 800, 25000)
    t = 1000 / kelvin
    x = np.where(
        kelvin < 4000,
        np.polyval([-0.2661239, -0.2343580, 0.8776956, 0.179910], t),
        np.polyval([-3.0258469, 2.1070379, 0.2226347, 0.240390], t),
    )
    low = np.polyval([-1.1063814, -1.34811020, 2.18555832, -0.20219683], x)
    middle = np.polyval([-0.9549476, -1.37418593, 2.09137015, -0.16748867], x)
    high = np.polyval([3.0817580, -5.87338670, 3.75112997, -0.37001483], x)
    y = np.where(kelvin < 2222, low, np.where(kelvin < 4000, middle, high))
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=1)
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    return np.maximum(xyz @ to_rgb.T, 0)


def artistic_ior(i: Inputs) -> dict[str, Rows]:
    r = np.clip(i["reflectivity"], 0, 0.99)
    ior = (1 - i["edge_color"]) * (1 + np.sqrt(r)) / (1 - np.sqrt(r)) + i["edge_color"] * (1 - r) / (1 + r)
    k2 = ((ior + 1) ** 2 * r - (ior - 1) ** 2) / (1 - r)
    return {"ior": ior, "extinction": np.sqrt(np.maximum(k2, 0))}


def hair_roughness(i: Inputs) -> dict[str, Rows]:
    b, n = np.clip(i["longitudinal"], 0.001, 1), np.clip(i["azimuthal"], 0.001, 1)
    v = (0.726 * b + 0.812 * b**2 + 3.7 * b**20) ** 2
    s = 0.265 * n + 1.194 * n**2 + 5.372 * n**22
    scales = {"roughness_R": np.ones_like(v), "roughness_TT": i["scale_TT"], "roughness_TRT": i["scale_TRT"]}
    return {name: np.hstack([v * scale**2, s]) for name, scale in scales.items()}


def absorption_of_color(i: Inputs) -> Rows:
    b = i["azimuthal_roughness"]
    below = 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5
    return np.asarray((np.log(np.clip(i["color"], 0.001, 1)) / below) ** 2)


def absorption_of_melanin(i: Inputs) -> Rows:
    melanin = -np.log(np.maximum(1 - i["melanin_concentration"], 0.0001))
    dark = melanin * (1 - i["melanin_redness"]) * -np.log(i["eumelanin_color"])
    light = melanin * i["melanin_redness"] * -np.log(i["pheomelanin_color"])
    return np.maximum(dark + light, 0)


def anisotropy(i: Inputs) -> Rows:
    square = np.clip(i["roughness"] ** 2, 1e-8, 1)
    aspect = np.where(i["anisotropy"] > 0, np.sqrt(1 - np.clip(i["anisotropy"], 0, 0.98)), 1)
    return np.hstack([np.minimum(square / aspect, 1), square * aspect])


def dual(i: Inputs) -> Rows:
    x, y = i["roughness"][:, :1], i["roughness"][:, 1:]
    return np.clip(np.hstack([x, np.where(y < 0, x, y)]) ** 2, 1e-8, 1)


PHYSICAL: dict[str, Callable[[Inputs], Rows | dict[str, Rows]]] = {
    "blackbody": blackbody, "artistic_ior": artistic_ior, "chiang_hair_roughness": hair_roughness,
    "chiang_hair_absorption_from_color": absorption_of_color, "deon_hair_absorption_from_melanin": absorption_of_melanin,
    "roughness_anisotropy": anisotropy, "roughness_dual": dual,
}  # fmt: skip
