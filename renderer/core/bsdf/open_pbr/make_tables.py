"""Writes tables.cpp: what lobes of the OpenPBR surface send on, by quadrature over the normals that are seen.

Run from the repository: python renderer/core/bsdf/open_pbr/make_tables.py (some minutes), then make format. Axes are in
make_albedo_table.py: roughness from the least one that is no mirror, and sqrt(mu (1 + 3 alpha) / (mu + 3 alpha)) of the cosine
mu. Interfaces go by (eta - 1) / (eta + 1), eta being the index beyond over the one before, in kReflectionTable by its root;
anisotropies by the root of what they leave of 1.

- kReflectionTable: a dielectric reflects T F(M), T being the albedo for F = 1. Stored is (M - mu) (roughness + 0.05) / alpha.
- kPassingTable: what a rough dielectric's single scattering reflects and transmits together; the rest is lost between facets.
- kBrushedTable: the albedo for F = 1 of an anisotropic lobe, over that of the isotropic lobe of the same roughness.

All are stored as whole numbers from 0 to 65535, which stand for the bounds below.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]

SMOOTHEST = 0.01
REFLECTION = (11, 20, 28)  # interfaces, roughnesses, cosines
MOST_EPSILON = 0.6
PASSING = (25, 14, 24)
PASSING_EPSILONS = (-0.6, 0.6)
BRUSHED = (10, 14, 20, 9)  # anisotropies, roughnesses, cosines, squared cosines of the azimuth
MOST_ANISOTROPY = 0.98
RANGES = {"reflection": (-1.0, 1.0), "passing": (0.0, 1.0), "brushed": (0.0, 2.0)}
SAMPLES = 192  # along each axis


def normals(wo: Doubles, alpha_t: float, alpha_b: float, count: int = SAMPLES) -> Doubles:
    """(count^2, 3) normals as they are seen along wo: Dupuy and Benyoub 2023, on a regular grid."""
    at = (np.arange(count) + 0.5) / count
    u, v = (x.ravel() for x in np.meshgrid(at, at, indexing="ij"))
    std = wo * (alpha_t, alpha_b, 1)
    std /= np.linalg.norm(std)
    z = (1 - v) * (1 + std[2]) - std[2]
    sine = np.sqrt(np.maximum(1 - z * z, 0))
    h = np.stack([sine * np.cos(2 * np.pi * u), sine * np.sin(2 * np.pi * u), z], -1) + std
    h *= (alpha_t, alpha_b, 1)
    return np.asarray(h / np.linalg.norm(h, axis=1, keepdims=True))


def smith_lambda(w: Doubles, alpha_t: float, alpha_b: float) -> Doubles:
    tan2 = ((w[..., 0] * alpha_t) ** 2 + (w[..., 1] * alpha_b) ** 2) / np.maximum(w[..., 2] ** 2, 1e-18)
    return np.asarray((np.sqrt(1 + tan2) - 1) / 2)


def fresnel(cosine: Doubles, eta: float) -> Doubles:
    """Of unpolarized light from a dielectric."""
    sin2 = (1 - cosine * cosine) / eta**2
    t = np.sqrt(np.maximum(1 - sin2, 0))
    s, p = (cosine - eta * t) / (cosine + eta * t), (eta * cosine - t) / (eta * cosine + t)
    return np.where(sin2 >= 1, 1.0, (s * s + p * p) / 2)


class Lobe:
    """A microfacet lobe seen along wo: normals, their cosines, and how much of what they reflect gets out."""

    def __init__(self, mu: float, azimuth: float, alpha_t: float, alpha_b: float) -> None:
        sine = np.sqrt(max(1 - mu * mu, 0.0))
        self.wo = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), mu])
        self.alphas = alpha_t, alpha_b
        self.h = normals(self.wo, alpha_t, alpha_b)
        self.facing = np.minimum(self.h @ self.wo, 1.0)
        self.reflected = self.gets_out(2 * self.facing[:, None] * self.h - self.wo, 1.0)

    def gets_out(self, wi: Doubles, side: float) -> Doubles:
        """Smith's G2 / G1(wo), with correlated heights: Heitz 2014, eq. 99."""
        own = smith_lambda(self.wo, *self.alphas)
        return np.where(wi[:, 2] * side > 0, (1 + own) / (1 + own + smith_lambda(wi, *self.alphas)), 0.0)

    def refracted(self, eta: float) -> tuple[Doubles, Doubles]:
        """F of each normal, and how much of what passes it gets out."""
        f = fresnel(self.facing, eta)
        cos_in = np.sqrt(np.maximum(1 - (1 - self.facing**2) / eta**2, 0))
        wi = self.h * (self.facing / eta - cos_in)[:, None] - self.wo / eta
        return f, self.gets_out(wi, -1.0)


def axis(shape: tuple[int, int], at: tuple[int, int]) -> tuple[float, float, float]:
    """Roughness, alpha and cosine of a node."""
    roughness = SMOOTHEST + (1 - SMOOTHEST) * at[0] / (shape[0] - 1)
    alpha, x2 = roughness**2, (at[1] / (shape[1] - 1)) ** 2
    return roughness, alpha, float(np.clip(3 * alpha * x2 / (1 + 3 * alpha - x2), 1e-4 * alpha, 1))


def spaced(bounds: tuple[float, float], count: int) -> Doubles:
    return np.linspace(*bounds, count)


def cosine_of(reflectance: float, eta: float) -> float:
    """At which a smooth interface reflects so much."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        if fresnel(np.array([middle]), eta)[0] > reflectance:
            low = middle
        else:
            high = middle
    return low


def reflection() -> Doubles:
    table = np.zeros(REFLECTION)
    for i, k in product(*map(range, REFLECTION[1:])):
        roughness, alpha, mu = axis(REFLECTION[1:], (i, k))
        lobe = Lobe(mu, 0.0, alpha, alpha)
        total = lobe.reflected.mean()
        for e, root in enumerate(spaced((0.0, 1.0), REFLECTION[0])):
            epsilon = max(MOST_EPSILON * root * root, 1e-3)
            eta = (1 + epsilon) / (1 - epsilon)
            cosine = cosine_of((lobe.reflected * fresnel(lobe.facing, eta)).mean() / total, eta)
            # Where F hardly changes with the cosine, rounding alone says what it is.
            table[e, i, k] = np.clip((cosine - mu) * (roughness + 0.05) / alpha, *RANGES["reflection"])
    return table


def passing() -> Doubles:
    table = np.ones(PASSING)
    for i, k in product(*map(range, PASSING[1:])):
        _, alpha, mu = axis(PASSING[1:], (i, k))
        lobe = Lobe(mu, 0.0, alpha, alpha)
        for e, epsilon in enumerate(spaced(PASSING_EPSILONS, PASSING[0])):
            f, out = lobe.refracted((1 + epsilon) / (1 - epsilon))
            table[e, i, k] = (f * lobe.reflected + (1 - f) * out).mean()
    return table


def brushed() -> Doubles:
    table = np.ones(BRUSHED)
    for a, root in enumerate(spaced((1.0, (1 - MOST_ANISOTROPY) ** 0.5), BRUSHED[0])):
        anisotropy = 1 - root**2
        for i, k in product(*map(range, BRUSHED[1:3])):
            _, alpha, mu = axis(BRUSHED[1:3], (i, k))
            alpha_t = alpha * np.sqrt(2 / (1 + (1 - anisotropy) ** 2))
            own = Lobe(mu, 0.0, alpha, alpha).reflected.mean()
            for p, cos2 in enumerate(spaced((0.0, 1.0), BRUSHED[3])):
                if a:
                    lobe = Lobe(mu, float(np.arccos(np.sqrt(cos2))), alpha_t, (1 - anisotropy) * alpha_t)
                    table[a, i, k, p] = lobe.reflected.mean() / own
    return table


def written(name: str, values: Doubles) -> str:
    low, high = RANGES[name]
    assert values.min() >= low, name
    assert values.max() <= high, name
    flat = [str(round(x)) for x in ((values - low) / (high - low) * 65535).ravel()]
    rows = ",\n    ".join(", ".join(flat[i : i + 17]) for i in range(0, len(flat), 17))
    return f"const float k{name.capitalize()}Table[] = {{\n    {rows}}};\n"


def main() -> None:
    tables = {"reflection": reflection(), "passing": passing(), "brushed": brushed()}
    text = '// Generated by make_tables.py: do not edit.\n#include "bsdf/open_pbr/tables.hpp"\n\nnamespace primray {\n\n'
    text += "\n".join(written(name, values) for name, values in tables.items()) + "\n}  // namespace primray\n"
    Path(__file__).with_name("tables.cpp").write_text(text)


if __name__ == "__main__":
    main()
