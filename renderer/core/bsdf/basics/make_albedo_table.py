"""Writes albedo_table.hpp: directional albedos of the GGX reflection lobe, by quadrature in double precision.

Run from the repository: python renderer/core/bsdf/basics/make_albedo_table.py (a minute). Reflection with Schlick's term is
linear in F0 and F90, so two numbers for each (roughness, cosine mu) give the albedo of any surface: E = T (F0 + (F90 - F0)
(1 - M)^5). T, the albedo for F = 1, and M, the cosine with the normals that counts for Fresnel's term, are functions of
mu / alpha near grazing: columns are even in sqrt(mu (1 + 3 alpha) / (mu + 3 alpha)), rows in roughness, from the least one
that is no mirror. M exceeds mu by about alpha log(1 / alpha) at the horizon and is stored as (M - mu) / (roughness^2 /
(roughness + 0.05)). A third curve gives what Fresnel's term takes from a white diffuse lobe: d(mu) = integral of
(1 - wo.h)^5 cos / pi over wi. Interpolated values are bounds, so that a surface built on them never reflects more than it
receives: T from above, M and d from below.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]

ROUGHNESSES, COSINES, LOSSES = 48, 64, 129
SMOOTHEST = 0.01  # sqrt(kMinAlpha); below it surfaces are mirrors
FINER = 4  # points of each cell, along each axis, where the bounds are checked
MARGIN = 1e-6  # of the bounds, for what lies between these points
ORDER = (32, 48)  # of the quadrature: around and along the slopes
BATCH = 256


def rule(order: int) -> tuple[Doubles, Doubles]:
    """Nodes and weights on (0, 1), dense at both ends: Gauss-Legendre's under the double exponential substitution of Takahasi
    and Mori 1974, "Double Exponential Formulas for Numerical Integration"."""
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = 2.4 * x, 2.4 * w
    nodes = 1 / (1 + np.exp(-np.pi * np.sinh(x)))
    return nodes, w * np.pi * np.cosh(x) * nodes * (1 - nodes)


def lobe_albedo(mu: Doubles, alpha: Doubles) -> tuple[Doubles, Doubles]:
    """T and T (1 - M)^5 for arrays (N,) of cosines and widths; 1e-6 or better (measured against orders of 160).

    Over the normals' slopes (r cos phi, r sin phi) towards the viewer, with r = alpha tan theta. Those that reflect above the
    horizon fill a disc that meets the ray at phi in r < exp(asinh(cos phi / tan theta_o)), so nothing is cut off inside a
    step. The ends to cluster at: the disc's edge, and phi = 90 degrees, where it changes within mu.
    """
    mu, alpha = mu[:, None, None], alpha[:, None, None]
    sine = np.sqrt((1 - mu) * (1 + mu))
    tangent = sine / mu
    masked = np.sqrt(1 + (alpha * tangent) ** 2)  # 1 + 2 Lambda(wo): Heitz 2014, eq. 72
    (around, w_around), (along, w_along) = rule(ORDER[0]), rule(ORDER[1])
    total, share = np.zeros(len(mu)), np.zeros(len(mu))
    for side in (1, -1):
        cos_phi = side * np.sin(np.pi / 2 * around)[:, None]
        reach = np.arctan(np.exp(np.arcsinh(tangent * cos_phi)) / alpha)
        theta = reach * along
        s, c = np.sin(theta), np.cos(theta)
        r = alpha * s / c
        facing = np.maximum(mu + sine * r * cos_phi, 0) / np.sqrt(1 + r * r)  # wo.h
        cos_in = np.maximum(2 * facing / np.sqrt(1 + r * r) - mu, 0)
        g2 = 2 * cos_in / (cos_in * masked + np.sqrt(cos_in**2 + alpha**2 * (1 - cos_in**2)))
        weight = w_around[:, None] * w_along * reach * s * (c + tangent * alpha * cos_phi * s) * g2
        total += weight.sum((1, 2))
        share += (weight * (1 - np.minimum(facing, 1)) ** 5).sum((1, 2))
    return total, share


def lobe_albedo_grid(mu: Doubles, alpha: Doubles) -> tuple[Doubles, Doubles]:
    """The same for arrays of any shape."""
    flat = [lobe_albedo(mu.flat[i : i + BATCH], alpha.flat[i : i + BATCH]) for i in range(0, mu.size, BATCH)]
    total, share = (np.concatenate(parts).reshape(mu.shape) for parts in zip(*flat, strict=True))
    return total, share


def diffuse_loss(mu: Doubles) -> Doubles:
    """d for an array (N,)."""
    (x, w_x), (y, w_y) = rule(64), rule(64)
    cos_phi, cos_in = np.cos(np.pi * x)[:, None], np.sqrt(y)
    cos_between = mu[:, None, None] * cos_in + np.sqrt((1 - mu**2)[:, None, None] * (1 - y)) * cos_phi
    facing = np.sqrt((1 + np.clip(cos_between, -1, 1)) / 2)
    return np.asarray(((1 - facing) ** 5 * w_x[:, None] * w_y).sum((1, 2)))


def interpolated(table: Doubles, y: Doubles, x: Doubles) -> Doubles:
    """Bilinear, at coordinates in cells."""
    i, j = np.minimum(y.astype(int), table.shape[0] - 2), np.minimum(x.astype(int), table.shape[1] - 2)
    fy, fx = y - i, x - j
    low, high = table[i, j] * (1 - fx) + table[i, j + 1] * fx, table[i + 1, j] * (1 - fx) + table[i + 1, j + 1] * fx
    return np.asarray(low * (1 - fy) + high * fy)


def bounded(exact: Doubles) -> Doubles:
    """Every FINER-th value of `exact`, moved until interpolation between them is nowhere below it, and close above."""
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
    # Neighbours raised each other too far. Nodes two apart share no cell and go down together; half the way at first, so
    # that what one could give up is not all taken by the other.
    for step in (0.5, 0.5, 0.5, 1.0):
        for parity_i in range(2):
            for parity_j in range(2):
                spare = np.maximum(interpolated(table, y, x) - exact - MARGIN, 0)
                i = 2 * np.round((y - parity_i) / 2).astype(int) + parity_i
                j = 2 * np.round((x - parity_j) / 2).astype(int) + parity_j
                weight = (1 - np.abs(y - i)) * (1 - np.abs(x - j))
                near = (np.abs(y - i) < 1) & (np.abs(x - j) < 1) & (i < table.shape[0]) & (j < table.shape[1])
                lower = np.full(table.shape, np.inf)
                np.minimum.at(lower, (i[near], j[near]), spare[near] / weight[near])
                table -= step * np.where(np.isinf(lower), 0, lower)
    return table


def lobe_tables() -> tuple[Doubles, Doubles]:
    """T and the scaled M - mu at the nodes, as bounds."""
    y, x = (np.linspace(0, 1, (n - 1) * FINER + 1) for n in (ROUGHNESSES, COSINES))
    roughness, column = np.meshgrid(SMOOTHEST + (1 - SMOOTHEST) * y, x, indexing="ij")
    alpha = roughness**2
    mu = np.clip(3 * alpha * column**2 / (1 + 3 * alpha - column**2), 1e-6 * alpha, 1)
    total, share = lobe_albedo_grid(mu, alpha)
    # Below a roughness of 0.3 the fifth root of almost nothing, towards mu = 1, is far from its neighbours: M goes to mu there
    # instead, and the bound may fail by 1e-5.
    fresnel_cosine = 1 - (share / total) ** 0.2
    tame = np.maximum(fresnel_cosine, mu)
    tame += (fresnel_cosine - tame) * np.clip(5 * roughness - 0.5, 0, 1)
    loose = 1 - (np.maximum(share - 1e-5 * mu**4, 0) / total) ** 0.2
    fresnel_cosine = np.minimum(loose, tame)
    excess = (fresnel_cosine - mu) * (roughness + 0.05) / alpha
    return bounded(total), -bounded(-excess)


def loss_table() -> Doubles:
    exact = diffuse_loss(np.linspace(0, 1, (LOSSES - 1) * FINER + 1))
    return np.maximum(-bounded(-np.array([exact] * (FINER + 1)))[0], 0)


def rows(values: Doubles) -> str:
    flat = [f"{x:.7f}f" for x in values.ravel()]
    return ",\n    ".join(", ".join(flat[i : i + 11]) for i in range(0, len(flat), 11))


def main() -> None:
    text = f"""\
// Generated by make_albedo_table.py: do not edit. Directional albedos of the GGX lobe, rows by roughness, columns by cosine:
// the albedo for F = 1 and the scaled excess of Fresnel's cosine, in pairs.
#pragma once

namespace primray {{

constexpr int kAlbedoRoughnesses = {ROUGHNESSES}, kAlbedoCosines = {COSINES}, kDiffuseFresnelLosses = {LOSSES};
constexpr float kAlbedoSmoothest = {SMOOTHEST}f;
constexpr float kAlbedoPairs[] = {{
    {rows(np.stack(lobe_tables(), axis=-1))}}};
constexpr float kDiffuseFresnelLoss[] = {{
    {rows(loss_table())}}};

}}  // namespace primray
"""
    Path(__file__).with_name("albedo_table.hpp").write_text(text)


if __name__ == "__main__":
    main()
