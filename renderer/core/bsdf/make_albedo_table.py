"""Writes albedo_table.hpp: directional albedos of the GGX reflection lobe, by quadrature in double precision.

Run from the repository: python renderer/core/bsdf/make_albedo_table.py (ten minutes). Reflection with Schlick's Fresnel term
is linear in F0 and F90, so two numbers for each (roughness, cosine) give the albedo of any surface: E = T (F0 + (F90 - F0)
(1 - M)^5). T, the albedo for F = 1, is a function of cosine / alpha near grazing, so its columns are even in
sqrt(mu (1 + alpha) / (mu + alpha)). M, the cosine with the normals that counts for Fresnel's term, exceeds mu by about alpha
there and is stored as (M - mu) / roughness, in sqrt(mu). A third curve gives what that term takes from a white diffuse lobe:
d(mu) = integral of (1 - wo.h)^5 cos / pi over wi. Interpolated values are bounds, so that a surface built on them never
reflects more than it receives: T from above, M and d from below.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

ROUGHNESSES, COSINES, STEPS = 33, 65, 256
FINER = 2  # points of each cell, along each axis, where the bounds are checked
MARGIN = 2e-5  # of the bounds, for what lies between these points


def ggx_albedo(mu: float, alpha: float) -> tuple[float, float]:
    """T and (1 - M)^5; midpoint rule over the visible normals (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with
    Spherical Caps")."""
    u, v = np.meshgrid((np.arange(STEPS) + 0.5) / STEPS, (np.arange(STEPS) + 0.5) / STEPS)
    wo = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    std = wo * [alpha, alpha, 1.0]
    std /= np.linalg.norm(std)
    z = (1 - v) * (1 + std[2]) - std[2]
    s = np.sqrt(np.clip(1 - z * z, 0, 1))
    h = np.stack([s * np.cos(2 * np.pi * u), s * np.sin(2 * np.pi * u), z], -1) + std
    m = h * [alpha, alpha, 1.0]
    m /= np.linalg.norm(m, axis=-1, keepdims=True)
    cos = m @ wo
    wi = 2 * cos[..., None] * m - wo

    def smith(w_z: np.ndarray | float) -> np.ndarray:
        return (np.sqrt(1 + alpha**2 * (1 / np.square(np.maximum(w_z, 1e-9)) - 1)) - 1) / 2

    up = wi[..., 2] > 0
    weight = np.where(up, (1 + smith(mu)) / (1 + smith(mu) + smith(wi[..., 2])), 0.0)
    f = (1 - np.clip(cos, 0, 1)) ** 5
    return float(weight.mean()), float((weight * f).mean() / weight.mean())


def diffuse_loss(mu: float) -> float:
    u, v = np.meshgrid((np.arange(STEPS) + 0.5) / STEPS, (np.arange(STEPS) + 0.5) / STEPS)
    r = np.sqrt(u)
    wi = np.stack([r * np.cos(2 * np.pi * v), r * np.sin(2 * np.pi * v), np.sqrt(1 - u)], -1)
    h = wi + np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return float(((1 - np.sum(h * wi, -1)) ** 5).mean())


def total_at(column: float, roughness: float) -> float:
    """T at its column coordinate. As roughness goes to 0 it goes to a function of the coordinate alone."""
    alpha, x = max(roughness, 1e-3) ** 2, column * column
    return ggx_albedo(min(max(x * alpha / max(1 + alpha - x, 1e-9), 1e-4 * alpha), 1.0), alpha)[0]


def fresnel_excess_at(column: float, roughness: float) -> float:
    """(M - mu) / roughness at its column coordinate."""
    mu = max(column * column, 1e-6)
    return 0.0 if roughness == 0 else (1 - ggx_albedo(mu, roughness**2)[1] ** 0.2 - mu) / roughness


def interpolated(table: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Bilinear, at coordinates in cells."""
    i, j = np.minimum(y.astype(int), table.shape[0] - 2), np.minimum(x.astype(int), table.shape[1] - 2)
    fy, fx = y - i, x - j
    low, high = table[i, j] * (1 - fx) + table[i, j + 1] * fx, table[i + 1, j] * (1 - fx) + table[i + 1, j + 1] * fx
    return low * (1 - fy) + high * fy


def bounded(exact: np.ndarray) -> np.ndarray:
    """Every FINER-th value of `exact`, raised until interpolation between them is nowhere below it."""
    table = exact[::FINER, ::FINER].copy()
    y, x = np.meshgrid(np.arange(exact.shape[0]) / FINER, np.arange(exact.shape[1]) / FINER, indexing="ij")
    for _ in range(8):
        missing = np.maximum(exact + MARGIN - interpolated(table, y, x), 0)
        for di in range(2):
            for dj in range(2):
                # Each point's share of the deficit goes to its cell's corners.
                i = np.minimum(np.minimum(y.astype(int), table.shape[0] - 2) + di, table.shape[0] - 1)
                j = np.minimum(np.minimum(x.astype(int), table.shape[1] - 2) + dj, table.shape[1] - 1)
                near = (np.abs(y - i) < 1) & (np.abs(x - j) < 1)
                np.maximum.at(table, (i[near], j[near]), table[i[near], j[near]] + 0.6 * missing[near])
    return table


def exact_grid(function: Callable[[float, float], float]) -> np.ndarray:
    y, x = (np.linspace(0, 1, (n - 1) * FINER + 1) for n in (ROUGHNESSES, COSINES))
    return np.array([[function(float(b), float(a)) for b in x] for a in y])


def rows(values: np.ndarray) -> str:
    flat = [f"{x:.7f}f" for x in values.ravel()]
    return ",\n    ".join(", ".join(flat[i : i + 11]) for i in range(0, len(flat), 11))


def main() -> None:
    loss = np.array([[diffuse_loss(mu) for mu in np.linspace(0, 1, (COSINES - 1) * FINER + 1)]] * (FINER + 1))
    text = f"""\
// Generated by make_albedo_table.py: do not edit. Directional albedos of the GGX lobe, rows by roughness, columns by cosine.
#pragma once

namespace primray {{

constexpr int kAlbedoRoughnesses = {ROUGHNESSES}, kAlbedoCosines = {COSINES};
constexpr float kAlbedoTotal[] = {{
    {rows(np.minimum(bounded(exact_grid(total_at)), 1))}}};
constexpr float kAlbedoFresnelExcess[] = {{
    {rows(-bounded(-exact_grid(fresnel_excess_at)))}}};
constexpr float kDiffuseFresnelLoss[] = {{
    {rows(np.maximum(-bounded(-loss)[0], 0))}}};

}}  // namespace primray
"""
    Path(__file__).with_name("albedo_table.hpp").write_text(text)


if __name__ == "__main__":
    main()
