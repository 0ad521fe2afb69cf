"""Irradiance under a sphere light under any linear map, and under directions: distant lights and domes.

The ellipsoid is integrated in its own space, where what the receiver sees of the unit sphere is a cap about the receiver's
direction: circles about that axis within, their radius without. Along a circle everything is a trigonometric polynomial of
degree 1 (planes) or 2 (cones), so cuts are its roots.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from tests.reference.adaptive import Doubles, Integers, Integral, outer, split
from tests.reference.emitters import Emitter

TAU = 2 * np.pi


def sphere_area(m: Doubles) -> float:
    """Of the unit sphere's image under m."""
    return _sphere_area(tuple(m.ravel().tolist()))


@lru_cache
def _sphere_area(entries: tuple[float, ...], order: int = 400) -> float:
    """Integral of |det m| |m^-T s|."""
    m = np.array(entries).reshape(3, 3)
    x, w = np.polynomial.legendre.leggauss(order)
    phi = (np.arange(2 * order) + 0.5) * np.pi / order
    r = np.sqrt(1 - x * x)[:, None]
    s = np.stack([r * np.cos(phi), r * np.sin(phi), np.broadcast_to(x[:, None], (order, 2 * order))], axis=-1)
    cofactor = np.linalg.det(m) * np.linalg.inv(m).T
    return float((np.linalg.norm(s @ cofactor.T, axis=-1) * w[:, None]).sum() * np.pi / order)


def sphere_irradiance(light: Emitter, m: Doubles, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    """m (3, 3): unit sphere to world, without the position."""
    inverse = np.linalg.inv(m)
    cofactor = abs(np.linalg.det(m)) * inverse.T
    own = (p - light.origin) @ inverse.T
    away = np.linalg.norm(own, axis=-1)
    outside = away > 1
    away = np.where(outside, away, 2.0)
    pole = np.where(outside[:, None], own, [0.0, 0, 2.0]) / away[:, None]
    x, y = _frame(pole)
    # sqrt((a - 1)(a + 1)): exact where the receiver is close to a huge sphere.
    cap = np.where(outside, np.arctan2(np.sqrt((away - 1) * (away + 1)), 1.0), 0.0)
    q0 = p - light.origin

    def inner(owner: Integers, alpha: Doubles) -> Doubles:
        sine, cosine = np.sin(alpha)[..., None], np.cos(alpha)[..., None]
        k = pole[owner][:, None] * cosine
        xs, ys = x[owner][:, None] * sine, y[owner][:, None] * sine
        q = q0[owner][:, None] - k @ m.T
        # d(phi) = q - xw cos(phi) - yw sin(phi), in the world.
        xw, yw = xs @ m.T, ys @ m.T
        cuts = np.concatenate(_breaks(light, q, xw, yw, n), axis=-1)
        zero = np.zeros(alpha.shape)
        line, phi, weight = split(zero, zero + TAU, np.concatenate([cuts, _thirds(alpha.shape)], axis=-1), order)
        c, s = np.cos(phi)[..., None], np.sin(phi)[..., None]

        def at(v: Doubles) -> Doubles:
            return v.reshape(-1, 3)[line][:, None]

        d = at(q) - at(xw) * c - at(yw) * s
        area = (at(k) + at(xs) * c + at(ys) * s) @ cofactor.T
        square = np.einsum("mki,mki->mk", d, d)
        facing = np.maximum(np.einsum("mki,mki->mk", d, area), 0)
        f = np.maximum(-d @ n, 0) * facing / square**2 * weight * sine.reshape(-1)[line][:, None]
        if light.shaping is None:
            value = f.sum(axis=1)[:, None]
        else:
            color = light.shaping.factor(d @ light.axis / np.sqrt(square), d @ np.linalg.inv(light.linear).T)
            value = np.einsum("mk,mkc->mc", f, color)
        total = np.zeros((alpha.size, value.shape[1]))
        np.add.at(total, line, value)
        return total.reshape(*alpha.shape, -1)

    return outer(inner, np.stack([np.zeros(cap.size), cap], axis=-1), relative, 6 * order, order)


def cap_irradiance(axis: Doubles, half_angle: float, n: Doubles, order: int = 24) -> float:
    """Under unit radiance from all directions within `half_angle` of -axis."""
    pole = -axis[None]
    x, y = _frame(pole)

    def inner(owner: Integers, theta: Doubles) -> Doubles:
        c, s = np.cos(theta), np.sin(theta)
        a, bx, by = c * (n @ pole[0]), s * (n @ x[0]), s * (n @ y[0])
        zero = np.zeros(theta.shape)
        line, phi, weight = split(zero, zero + TAU, np.concatenate([_circle(a, bx, by), _thirds(theta.shape)], -1), order)

        def at(v: Doubles) -> Doubles:
            return v.ravel()[line][:, None]

        f = np.maximum(at(a) + at(bx) * np.cos(phi) + at(by) * np.sin(phi), 0) * weight * at(s)
        total = np.zeros(theta.size)
        np.add.at(total, line, f.sum(axis=1))
        return total.reshape(*theta.shape, 1)

    return float(outer(inner, np.array([[0.0, half_angle]]), 1e-9).value[0, 0])


def _frame(pole: Doubles) -> tuple[Doubles, Doubles]:
    """Two unit vectors across each pole (R, 3)."""
    aside = np.where(np.abs(pole[:, :1]) < 0.6, [1.0, 0, 0], [0.0, 1.0, 0])
    x = np.cross(aside, pole)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return x, np.cross(pole, x)


def _thirds(shape: tuple[int, ...]) -> Doubles:
    """Full circles are at least in three pieces."""
    return np.broadcast_to(np.array([TAU / 3, 2 * TAU / 3]), (*shape, 2))


def _circle(a: Doubles, x: Doubles, y: Doubles) -> Doubles:
    """phi in [0, 2 pi) at which a + x cos(phi) + y sin(phi) = 0, NaN if none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        middle, half = np.arctan2(y, x), np.arccos(-a / np.hypot(x, y))
    return np.mod(np.stack([middle - half, middle + half], axis=-1), TAU)


def _breaks(light: Emitter, q: Doubles, x: Doubles, y: Doubles, n: Doubles) -> list[Doubles]:
    found = [_circle(q @ n, -x @ n, -y @ n)]
    shaping = light.shaping
    if shaping is not None:
        a = light.axis
        if shaping.focus > 0:
            found.append(_circle(q @ a, -x @ a, -y @ a))
        found += [_cone(q, x, y, a, angle) for angle in shaping.cone_angles]
        inverse = np.linalg.inv(light.linear).T
        q, x, y = q @ inverse, x @ inverse, y @ inverse
        found += [_kinks(q, x, y, axis, angle) for axis, angle in shaping.profile_cones]
        found += [_circle(q @ plane, -x @ plane, -y @ plane) for plane in shaping.profile_planes]
    return found


def _on_cone(q: Doubles, x: Doubles, y: Doubles, axis: Doubles, angle: float) -> npt.NDArray[np.complex128]:
    """Coefficients of exp(i k phi), k = -2 .. 2, of what is 0 where d = q - x cos - y sin is on the cone: by five values."""
    phi = np.arange(5) * TAU / 5
    d = q[..., None, :] - x[..., None, :] * np.cos(phi)[:, None] - y[..., None, :] * np.sin(phi)[:, None]
    e = (d @ axis) ** 2 - np.cos(angle) ** 2 * np.einsum("...i,...i->...", d, d)
    return np.asarray(e @ np.exp(-1j * np.outer(phi, np.arange(-2, 3))) / 5)


def _kinks(q: Doubles, x: Doubles, y: Doubles, axis: Doubles, angle: float) -> Doubles:
    """phi in [0, 2 pi) on a cone where the integrand only bends: found by signs; close pairs may be passed over."""
    c = _on_cone(q, x, y, axis, angle)
    # Real form: constant, cosines, sines.
    a = np.stack([c[..., 2].real, 2 * c[..., 3].real, -2 * c[..., 3].imag, 2 * c[..., 4].real, -2 * c[..., 4].imag], axis=-1)

    def value(phi: Doubles, a: Doubles) -> Doubles:
        wave = np.stack([np.ones_like(phi), np.cos(phi), np.sin(phi), np.cos(2 * phi), np.sin(2 * phi)], axis=-1)
        return np.asarray((a * wave).sum(axis=-1))

    phi = np.arange(25) * TAU / 24
    wave = np.stack([np.ones_like(phi), np.cos(phi), np.sin(phi), np.cos(2 * phi), np.sin(2 * phi)])
    above = a @ wave > 0
    crossed = above[..., 1:] != above[..., :-1]
    where = np.nonzero(crossed)
    low, high, own = phi[where[-1]], phi[where[-1] + 1], a[where[:-1]]
    start = above[where]
    for _ in range(40):
        middle = (low + high) / 2
        same = (value(middle, own) > 0) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    rank = np.cumsum(crossed, axis=-1)[where] - 1
    out = np.full((*q.shape[:-1], 4), np.nan)
    few = rank < 4
    out[(*(i[few] for i in where[:-1]), rank[few])] = low[few]
    return out


def _cone(q: Doubles, x: Doubles, y: Doubles, axis: Doubles, angle: float) -> Doubles:
    """phi in [0, 2 pi) on a cone where the integrand may jump: phases of the roots of a quartic in exp(i phi)."""
    c = _on_cone(q, x, y, axis, angle)
    size = np.abs(c).max(axis=-1, keepdims=True)
    lead = np.where(np.abs(c[..., 4:]) > 1e-13 * size, c[..., 4:], 1e-13 * size + 1e-300)
    companion = np.zeros((*q.shape[:-1], 4, 4), complex)
    companion[..., 1:, :3] = np.eye(3)
    companion[..., :, 3] = -c[..., :4] / lead
    z = np.linalg.eigvals(companion)
    on = np.abs(np.abs(z) - 1) < 1e-3
    return np.where(on, np.mod(np.angle(z), TAU), np.nan)
