"""Directional albedos of the surface model in double precision, from the formulas in bsdf.hpp's head and not from its code.

Each lobe is integrated in the variables that make it smooth: the diffuse one over cosines and azimuths, a GGX lobe over its
slopes p towards the viewer and q across (D(h) cos theta_h dh = alpha^2 dp dq / (pi (alpha^2 + p^2 + q^2)^2)). What reflects
above the horizon fills a disc of slopes, around tan theta_o with radius 1 / cos theta_o. The tables' generator goes through
it along rays from the origin, this module along lines of constant p, so neither repeats the other's mistakes.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from primray.description import Surface

Doubles = npt.NDArray[np.float64]
NODES = 64  # of the one-dimensional interpolants of albedos


@cache
def gauss(order: int) -> tuple[Doubles, Doubles]:
    """Gauss-Legendre nodes and weights on (0, 1)."""
    x, w = np.polynomial.legendre.leggauss(order)
    return (x + 1) / 2, w / 2


@cache
def dense_at_0(order: int) -> tuple[Doubles, Doubles]:
    """The same after x = y^3: for a root or a logarithm at 0."""
    y, w = gauss(order)
    return y**3, 3 * y * y * w


@cache
def diffuse_directions() -> tuple[Doubles, Doubles, Doubles]:
    """Cosines of wi, azimuths in [0, pi] from wo's, and weights of a cosine-distributed direction, flat."""
    (x, wx), (y, wy) = gauss(48), gauss(96)
    azimuth, cos_in = np.meshgrid(np.pi * (1 - x * x), y, indexing="ij")  # dense where wi faces wo at the horizon
    return cos_in.ravel(), azimuth.ravel(), np.outer(2 * x * wx, 2 * y * wy).ravel()


def cosine_to_half(mu: float, cos_in: Doubles, azimuth: Doubles) -> Doubles:
    between = mu * cos_in + np.sqrt((1 - mu * mu) * (1 - cos_in**2)) * np.cos(azimuth)
    return np.sqrt((1 + np.clip(between, -1, 1)) / 2)


def lambda_(cos: Doubles | float, alpha: float) -> Doubles | float:
    """Smith's, by the tangent: Heitz 2014, eq. 72."""
    c2 = np.square(np.maximum(cos, 1e-12))
    return (np.sqrt(1 + alpha * alpha * (1 - c2) / c2) - 1) / 2


@cache
def lobe_directions(mu: float, alpha: float) -> tuple[Doubles, Doubles, Doubles]:
    """Cosines of wi, of wo against h, and weights whose sum over F(wo.h) is the lobe's integral of f cos."""
    sine = np.sqrt((1 - mu) * (1 + mu))
    near, far = mu / (1 + sine), (1 + sine) / mu  # the disc spans p from -near to far
    start, end = np.arcsinh(-near / alpha), np.arcsinh(far / alpha)
    (x, wx), (y, wy) = dense_at_0(80), gauss(40)
    # p = alpha sinh; the other end of the disc is far out, where little is left.
    at = start + (end - start) * x
    p, dp = alpha * np.sinh(at), alpha * np.cosh(at) * (end - start) * wx
    # q = width tan(angle), up to the disc's rim; both signs of q are the same.
    width = np.sqrt(alpha**2 + p * p)
    rim = np.arctan(np.sqrt(np.maximum((p + near) * (far - p), 0)) / width)
    p, width = p[:, None], width[:, None]
    angle = rim[:, None] * y
    q = width * np.tan(angle)
    density = alpha**2 / np.pi / width**3 * np.cos(angle) ** 2 * 2 * dp[:, None] * rim[:, None] * wy
    up = 1 / np.sqrt(1 + p * p + q * q)  # h.z
    cos_h = (mu + sine * p) * up
    cos_in = 2 * cos_h * up - mu
    above = (cos_h > 0) & (cos_in > 0)
    g2 = 1 / (1 + lambda_(mu, alpha) + lambda_(np.where(above, cos_in, 1.0), alpha))
    weight = np.where(above, g2 * (mu + sine * p) / mu * density, 0.0)
    return np.where(above, cos_in, 0.5).ravel(), np.clip(cos_h, 0, 1).ravel(), weight.ravel()


@cache
def lobe_albedo(mu: float, alpha: float) -> tuple[float, float]:
    """(a, b) of E = F0 a + F90 b."""
    _, cos_h, weight = lobe_directions(mu, alpha)
    s = (1 - cos_h) ** 5
    return float(np.sum(weight * (1 - s))), float(np.sum(weight * s))


def nodes(low: float, high: float) -> Doubles:
    """Chebyshev's, of NODES terms."""
    return low + (high - low) * (1 - np.polynomial.chebyshev.chebpts1(NODES)) / 2


def fitted(low: float, high: float, values: Doubles) -> np.polynomial.Chebyshev:
    """The interpolant of values (NODES,) at nodes(low, high)."""
    return np.polynomial.Chebyshev.fit(nodes(low, high), values, NODES - 1, domain=[low, high])


@cache
def lobe_albedo_curve(alpha: float) -> tuple[np.polynomial.Chebyshev, np.polynomial.Chebyshev]:
    """a and b of sqrt(arcsinh(mu / alpha)); there is a logarithm at 0."""
    end = float(np.sqrt(np.arcsinh(1 / alpha)))
    pairs = np.array([lobe_albedo(float(alpha * np.sinh(x * x)), alpha) for x in nodes(0, end)])
    return fitted(0, end, pairs[:, 0]), fitted(0, end, pairs[:, 1])


def lobe_albedos(mu: Doubles | float, alpha: float) -> tuple[Doubles, Doubles]:
    """lobe_albedo for an array of cosines."""
    a, b = lobe_albedo_curve(alpha)
    x = np.sqrt(np.arcsinh(np.asarray(mu) / alpha))
    return np.asarray(a(x)), np.asarray(b(x))


@cache
def fresnel_loss_curve() -> np.polynomial.Chebyshev:
    """The integral of (1 - wo.h)^5 cos / pi over wi, of sqrt(mu)."""
    cos_in, azimuth, weight = diffuse_directions()
    loss = [np.sum(weight * (1 - cosine_to_half(float(x * x), cos_in, azimuth)) ** 5) for x in nodes(0, 1)]
    return fitted(0, 1, np.array(loss))


class PreviewSurface:
    """One gray surface (its first channel) seen from outside."""

    def __init__(self, s: Surface) -> None:
        f0_dielectric = ((1 - s.ior) / (1 + s.ior)) ** 2
        base = s.diffuse_color[0]
        metallic = 0.0 if s.use_specular_workflow else s.metallic
        tint = 1 - metallic + metallic * base
        self.f0 = s.specular_color[0] if s.use_specular_workflow else (1 - metallic) * f0_dielectric * tint + metallic * tint
        self.f90 = 1.0 if s.use_specular_workflow else tint
        self.diffuse = base * (1 - metallic) * s.opacity
        self.opacity = s.opacity
        self.alpha = 0.0 if s.roughness**2 < 1e-4 else s.roughness**2
        self.coat, self.coat_f0 = s.clearcoat, f0_dielectric
        self.coat_alpha = max(s.clearcoat_roughness**2, 1e-4)

    def fresnel(self, cos: Doubles | float) -> Doubles | float:
        return self.f0 + (self.f90 - self.f0) * (1 - cos) ** 5

    def specular_albedo(self, mu: Doubles | float) -> Doubles:
        """E, of the base's GGX lobe or mirror alone."""
        if self.alpha == 0:
            return np.asarray(self.fresnel(mu))
        a, b = lobe_albedos(mu, self.alpha)
        return np.asarray(self.f0 * a + self.f90 * b)

    def keep_diffuse(self, mu: Doubles | float) -> Doubles:
        d = 1 - (self.f0 + (self.f90 - self.f0) * fresnel_loss_curve()(np.sqrt(mu)))
        return np.minimum((1 - np.minimum(self.specular_albedo(mu), 1)) / np.maximum(d, 1e-6), 1)

    def keep_under_coat(self, mu: Doubles | float) -> Doubles:
        a, b = lobe_albedos(mu, self.coat_alpha)
        return np.asarray(1 - self.coat * (self.coat_f0 * a + b))

    def albedo(self, mu: float) -> float:
        """Fraction of light from one direction that is reflected or passes."""
        coat_out = self.keep_under_coat(mu)
        cos_in, azimuth, weight = diffuse_directions()
        base = self.diffuse * (1 - self.fresnel(cosine_to_half(mu, cos_in, azimuth)))
        base *= self.keep_diffuse(mu) * self.keep_diffuse(cos_in)
        total = float(np.sum(weight * base * coat_out * self.keep_under_coat(cos_in)))
        # The specular lobe over its slopes, or as a mirror.
        if self.alpha == 0:
            total += float(self.fresnel(mu) * coat_out * coat_out)
        else:
            cos_in, cos_h, weight = lobe_directions(mu, self.alpha)
            total += float(np.sum(weight * self.fresnel(cos_h) * coat_out * self.keep_under_coat(cos_in)))
        if self.coat:
            a, b = lobe_albedo(mu, self.coat_alpha)
            total += self.coat * (self.coat_f0 * a + b)
        return total + float((1 - min(float(self.specular_albedo(mu)), 1.0)) * (1 - self.opacity) * coat_out)
