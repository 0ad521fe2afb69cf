"""Irradiance under what is made of straight lines: rects, disks, triangles, cylinders.

A piece of light is a family of lines x = base(u) + t b, t in [low(u), high(u)]. Along one, the direction of emission d = P - x
is linear in t, so the receiver's horizon, cones and planes about an axis, and rows of texels cut it at roots of a linear or
quadratic equation. t = foot + distance sinh(xi) takes the peak of 1 / d^4 away, however near the receiver is to the line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from tests.reference.adaptive import Doubles, Integers, Integral, outer, split
from tests.reference.emitters import Emitter

# In xi: the integrand falls like cosh^-3, so that one rule does not do for a line of 1e6 distances.
_FAR = np.array([-16.0, -8.0, -4.0, -2.0, 2.0, 4.0, 8.0, 16.0])


@dataclass(frozen=True)
class Lines:
    base: Callable[[Doubles], Doubles]  # u (...) -> (..., 3)
    b: Doubles  # (3,)
    limits: Callable[[Doubles], tuple[Doubles, Doubles]]
    area: Callable[[Doubles], Doubles]  # u -> (..., 3): the area's vector for du dt, out of the emitting side
    range: Callable[[Doubles], Doubles]  # receivers (R, 3) -> (R, E): ascending edges of u
    texel: Callable[[Doubles, Doubles], tuple[Doubles, Doubles]] | None = None  # u, t -> s, t of the picture
    texel_lines: Doubles = field(default_factory=lambda: np.zeros(0))  # in t


def irradiance(light: Emitter, lines: Lines, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    """Of receivers p (R, 3) facing n, for unit radiance times texture and shaping: (R, C)."""

    def inner(owner: Integers, u: Doubles) -> Doubles:
        q = p[owner][:, None] - lines.base(u)
        low, high = np.broadcast_arrays(*lines.limits(u))
        value = _along(light, lines, q, u, low, high, n, order)
        return value.reshape(*u.shape, -1)

    edges = lines.range(p)
    if light.shaping is not None:
        edges = np.sort(np.concatenate([edges, *_jumps(light, lines, p, edges)], axis=1), axis=1)
    pieces = 3 + (0 if light.shaping is None else 2 * len(light.shaping.cone_angles) + 2 * len(light.shaping.profile_cones) + 2)
    return outer(inner, edges, relative, order * pieces, order)


def _jumps(light: Emitter, lines: Lines, p: Doubles, edges: Doubles) -> list[Doubles]:
    """(R, K) each: u at which a whole line passes out of a cone of 90 degrees, or off the end of a profile."""
    inverse = np.linalg.inv(light.linear)
    found = []
    profile = [] if light.shaping is None else light.shaping.profile_planes
    for normal in (light.axis, inverse[2], *(n @ inverse for n in profile)):
        if abs(normal @ lines.b) > 1e-6 * np.linalg.norm(normal) * np.linalg.norm(lines.b):
            continue  # crossed along the lines instead
        low, high = edges[:, :1], edges[:, -1:]
        u = low + (high - low) * np.linspace(0, 1, 65)

        def side(u: Doubles, normal: Doubles = normal) -> Doubles:
            return (p[:, None] - lines.base(u)) @ normal

        a, b = u[:, :-1], u[:, 1:]
        at_a = side(a)
        crossed = at_a * side(b) < 0
        for _ in range(60):
            middle = (a + b) / 2
            before = side(middle) * at_a > 0
            a, b = np.where(before, middle, a), np.where(before, b, middle)
        found.append(np.where(crossed, a, low))
    return found


def _along(
    light: Emitter, lines: Lines, q: Doubles, u: Doubles, low: Doubles, high: Doubles, n: Doubles, order: int
) -> Doubles:
    b = lines.b
    foot = q @ b / (b @ b)
    distance = np.linalg.norm(q - foot[..., None] * b, axis=-1) / np.linalg.norm(b)
    distance = np.maximum(distance, 1e-14 * (np.abs(foot) + np.abs(high) + np.abs(low)) + 1e-300)

    def xi(t: Doubles) -> Doubles:
        return np.arcsinh((t - foot[..., None]) / distance[..., None])

    cuts = xi(np.concatenate([foot[..., None], *_breaks(light, lines, q, n)], axis=-1))
    cuts = np.concatenate([cuts, np.broadcast_to(_FAR, (*u.shape, _FAR.size))], axis=-1)
    ends = xi(np.stack([low, high], axis=-1))
    line, x, weight = split(ends[..., 0], ends[..., 1], cuts, order)

    flat_q, flat_u = q.reshape(-1, 3)[line], u.ravel()[line]
    flat_foot, flat_distance = foot.ravel()[line][:, None], distance.ravel()[line][:, None]
    offset = flat_distance * np.sinh(x)
    t = flat_foot + offset
    weight = weight * flat_distance * np.cosh(x)
    d = (flat_q - flat_foot * b)[:, None] - offset[..., None] * b
    square = np.einsum("mki,mki->mk", d, d)
    facing = np.maximum(np.einsum("mki,mi->mk", d, lines.area(flat_u)), 0)
    f = np.maximum(-d @ n, 0) * facing / square**2 * weight
    out = _times_radiance(light, lines, f, d, np.sqrt(square), flat_u, t)
    total = np.zeros((u.size, out.shape[-1]))
    np.add.at(total, line, out)
    return total


def _times_radiance(light: Emitter, lines: Lines, f: Doubles, d: Doubles, length: Doubles, u: Doubles, t: Doubles) -> Doubles:
    """Sum over the nodes: (M, C), one channel where all are alike."""
    if light.shaping is None and light.picture is None:
        return f.sum(axis=1)[:, None]
    color = np.ones((*f.shape, 3))
    if light.shaping is not None:
        color = light.shaping.factor(d @ light.axis / length, d @ np.linalg.inv(light.linear).T)
    if light.picture is not None and lines.texel is not None:
        color = color * light.picture.at(*lines.texel(np.broadcast_to(u[:, None], t.shape), t))
    return np.einsum("mk,mkc->mc", f, color)


def _breaks(light: Emitter, lines: Lines, q: Doubles, n: Doubles) -> list[Doubles]:
    with np.errstate(divide="ignore", invalid="ignore"):
        found = [_plane(q, lines.b, n)]
        if lines.texel_lines.size:
            found.append(np.broadcast_to(lines.texel_lines, (*q.shape[:-1], lines.texel_lines.size)))
        if light.shaping is not None:
            found += [_cone(q, lines.b, light.axis, a) for a in light.shaping.cone_angles]
            found.append(_plane(q, lines.b, light.axis))
            inverse = np.linalg.inv(light.linear)
            own_q, own_b = q @ inverse.T, inverse @ lines.b
            found += [_cone(own_q, own_b, axis, a) for axis, a in light.shaping.profile_cones]
            found += [_plane(own_q, own_b, normal) for normal in light.shaping.profile_planes]
    return found


def _plane(q: Doubles, b: Doubles, normal: Doubles) -> Doubles:
    return (q @ normal / (b @ normal))[..., None]


def _cone(q: Doubles, b: Doubles, axis: Doubles, angle: float) -> Doubles:
    """t at which q - t b makes `angle` with the axis, or its opposite: a cut too many does no harm."""
    c2 = np.cos(angle) ** 2
    aa = (axis @ b) ** 2 - c2 * (b @ b)
    half = -((q @ axis) * (axis @ b) - c2 * (q @ b))
    cc = (q @ axis) ** 2 - c2 * np.einsum("...i,...i->...", q, q)
    root = np.sqrt(half**2 - aa * cc)
    # The stable pair of roots (Press et al., Numerical Recipes, 5.6).
    z = -(half + np.where(half >= 0, root, -root))
    return np.stack([z / aa, cc / z], axis=-1)
