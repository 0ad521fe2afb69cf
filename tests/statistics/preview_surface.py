"""Directional albedos of the surface model in double precision, from the formulas in bsdf.hpp's head and not from its code.

Each lobe is integrated in the variables that make it smooth: the diffuse one over cosine-distributed directions, a GGX
lobe over its slopes (tan theta_h = alpha r, so that D(h) cos theta_h dh = r dr dphi / (pi (1 + r^2)^2)).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from primray.description import Surface

Doubles = npt.NDArray[np.float64]
STEPS = 224
NODES = 97  # of the one-dimensional tables of albedos


def unit_grid(steps: int) -> tuple[Doubles, Doubles]:
    x = (np.arange(steps) + 0.5) / steps
    u, v = np.meshgrid(x, x, indexing="ij")
    return u.ravel(), v.ravel()


def lambda_(cos: Doubles | float, alpha: float) -> Doubles | float:
    """Smith's, by the tangent: Heitz 2014, eq. 72."""
    c2 = np.square(np.maximum(cos, 1e-12))
    return (np.sqrt(1 + alpha * alpha * (1 - c2) / c2) - 1) / 2


def view(mu: float) -> Doubles:
    return np.array([np.sqrt(max(1 - mu * mu, 0.0)), 0.0, mu])


def lobe_directions(mu: float, alpha: float) -> tuple[Doubles, Doubles, Doubles]:
    """Cosines of wi, of wo against h, and weights whose sum over F(wo.h) is the lobe's integral of f cos."""
    # r^2 / (1 + r^2) = 1 - (1 - t)^2 is even in probability but for the factor 2 (1 - t), which tames the far slopes that
    # grazing views weigh most.
    t, phi = unit_grid(STEPS)
    phi = 0.5 * phi  # both halves are the same
    r = alpha * np.sqrt(t * (2 - t)) / (1 - t)
    slopes = np.stack([r * np.cos(2 * np.pi * phi), r * np.sin(2 * np.pi * phi), np.ones_like(r)], axis=1)
    h = slopes / np.linalg.norm(slopes, axis=1)[:, None]
    wo = view(mu)
    cos_h = h @ wo
    cos_in = 2 * cos_h * h[:, 2] - mu
    up = (cos_h > 0) & (cos_in > 0)
    g2 = 1 / (1 + lambda_(mu, alpha) + lambda_(np.where(up, cos_in, 1.0), alpha))
    weight = np.where(up, g2 * cos_h / (mu * h[:, 2]), 0.0) * 2 * (1 - t) / len(t)
    return np.where(up, cos_in, 0.5), np.clip(cos_h, 0, 1), weight


@cache
def lobe_albedo(mu: float, alpha: float) -> tuple[float, float]:
    """(a, b) of E = F0 a + F90 b."""
    _, cos_h, weight = lobe_directions(mu, alpha)
    s = (1 - cos_h) ** 5
    return float(np.sum(weight * (1 - s))), float(np.sum(weight * s))


@cache
def lobe_albedo_curve(alpha: float) -> tuple[Doubles, Doubles, Doubles]:
    """Cosines, denser towards grazing, and a, b there."""
    mu = np.linspace(0.02, 1, NODES) ** 2
    pairs = np.array([lobe_albedo(float(m), alpha) for m in mu])
    return mu, pairs[:, 0], pairs[:, 1]


@cache
def fresnel_loss_curve() -> tuple[Doubles, Doubles]:
    """Cosines and the integral of (1 - wo.h)^5 cos / pi over wi."""
    mu = np.linspace(0.0, 1, NODES)
    u, v = unit_grid(STEPS)
    r = np.sqrt(u)
    wi = np.stack([r * np.cos(2 * np.pi * v), r * np.sin(2 * np.pi * v), np.sqrt(1 - u)], axis=1)
    loss = []
    for m in mu:
        h = wi + view(float(m))
        loss.append(np.mean((1 - np.sum(h * wi, axis=1) / np.linalg.norm(h, axis=1)) ** 5))
    return mu, np.array(loss)


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
        nodes, a, b = lobe_albedo_curve(self.alpha)
        return np.asarray(self.f0 * np.interp(mu, nodes, a) + self.f90 * np.interp(mu, nodes, b))

    def keep_diffuse(self, mu: Doubles | float) -> Doubles:
        nodes, loss = fresnel_loss_curve()
        d = 1 - (self.f0 + (self.f90 - self.f0) * np.interp(mu, nodes, loss))
        return np.minimum((1 - np.minimum(self.specular_albedo(mu), 1)) / np.maximum(d, 1e-6), 1)

    def keep_under_coat(self, mu: Doubles | float) -> Doubles:
        nodes, a, b = lobe_albedo_curve(self.coat_alpha)
        return np.asarray(1 - self.coat * (self.coat_f0 * np.interp(mu, nodes, a) + np.interp(mu, nodes, b)))

    def albedo(self, mu: float) -> float:
        """Fraction of light from one direction that is reflected or passes."""
        coat_out = self.keep_under_coat(mu)
        # The diffuse lobe over cosine-distributed directions.
        u, v = unit_grid(STEPS)
        r = np.sqrt(u)
        cos_in = np.sqrt(1 - u)
        wi = np.stack([r * np.cos(2 * np.pi * v), r * np.sin(2 * np.pi * v), cos_in], axis=1)
        h = wi + view(mu)
        cos_h = np.sum(h * wi, axis=1) / np.linalg.norm(h, axis=1)
        base = self.diffuse * (1 - self.fresnel(cos_h)) * self.keep_diffuse(mu) * self.keep_diffuse(cos_in)
        total = float(np.mean(base * coat_out * self.keep_under_coat(cos_in)))
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
