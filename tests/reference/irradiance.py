"""What a Lambert plane receives from every light of a stage, by quadrature of UsdLux's text: the referee's answer.

`irradiance` gives E (R, 3) with a bound on its error; a plane of albedo a that nothing shadows shows a E / pi.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tests.reference.adaptive import Doubles, Integral
from tests.reference.domes import dome_irradiance
from tests.reference.emitters import Emitter
from tests.reference.lines import Lines
from tests.reference.lines import irradiance as under_lines
from tests.reference.round_shapes import cap_irradiance, sphere_area, sphere_irradiance

ORDER = 12  # nodes of a smooth piece within; the second order that checks it is half as much again
RELATIVE = 5e-6


def irradiance(lights: Sequence[Emitter], p: Doubles, n: Doubles, order: int = ORDER, relative: float = RELATIVE) -> Integral:
    total, error = np.zeros((p.shape[0], 3)), np.zeros(p.shape[0])
    for light in lights:
        one = irradiance_of(light, p, n, order, relative)
        total, error = total + one.value, error + one.error
    return Integral(total, error)


def irradiance_of(light: Emitter, p: Doubles, n: Doubles, order: int = ORDER, relative: float = RELATIVE) -> Integral:
    parts = [_PARTS[light.kind](light, p, n, order, relative)]
    value = np.sum([part.value for part in parts], axis=0)
    scale = light.radiance / (size_factor(light) if light.normalize else 1.0)
    return Integral(value * scale, sum(part.error for part in parts) * scale.max())


def size_factor(light: Emitter) -> float:
    """LightAPI, inputs:normalize."""
    m, size = light.linear, light.size
    match light.kind:
        case "Distant":
            half = half_angle(light)
            if half == 0:
                return 1.0
            return np.pi * np.sin(half) ** 2 if half <= np.pi / 2 else np.pi * (2 - np.sin(half) ** 2)
        case "Sphere":
            return sphere_area(m * size["radius"])
        case "Disk":
            return np.pi * size["radius"] ** 2 * _span(m[:, 0], m[:, 1])
        case "Rect":
            return size["width"] * size["height"] * _span(m[:, 0], m[:, 1])
        case "Cylinder":
            psi = (np.arange(4096) + 0.5) * 2 * np.pi / 4096
            around = -np.outer(np.sin(psi), m[:, 1]) + np.outer(np.cos(psi), m[:, 2])
            girth = np.linalg.norm(np.cross(around, m[:, 0]), axis=-1).mean() * 2 * np.pi * size["radius"]
            return float(girth * size["length"])
        case "Mesh":
            t = light.triangles @ m.T
            return float(sum(_span(b - a, c - a) for a, b, c in t) / 2)
    return 1.0  # domes ignore it


def half_angle(light: Emitter) -> float:
    return float(np.clip(np.radians(light.size["angle"]) / 2, 0, np.pi))


def _span(a: Doubles, b: Doubles) -> float:
    return float(np.linalg.norm(np.cross(a, b)))


def _distant(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    half = half_angle(light)
    e = max(-light.axis @ n, 0.0) if half == 0 else cap_irradiance(light.axis, half, n)
    return Integral(np.full((p.shape[0], 1), e), np.zeros(p.shape[0]))


def _dome(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    e = dome_irradiance(light, tuple(n.tolist()))
    return Integral(np.broadcast_to(e, (p.shape[0], e.size)), np.zeros(p.shape[0]))


def _sphere(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    m = light.linear * light.size["radius"]
    if light.point_or_line:
        return _point(light, m, p, n)
    return sphere_irradiance(light, m, p, n, order, relative)


def _point(light: Emitter, m: Doubles, p: Doubles, n: Doubles) -> Integral:
    """The limit of the sphere as it shrinks and grows brighter: radiant intensity L times a quarter of its surface."""
    d = p - light.origin
    r = np.linalg.norm(d, axis=-1)
    d = d / r[:, None]
    e = np.maximum(-d @ n, 0) / r**2 * sphere_area(m) / 4
    if light.shaping is None:
        return Integral(e[:, None], np.zeros(p.shape[0]))
    return Integral(e[:, None] * light.shaping.factor(d @ light.axis, d @ np.linalg.inv(light.linear).T), np.zeros(p.shape[0]))


def _rect(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    a, b = light.linear[:, 0] * light.size["width"], light.linear[:, 1] * light.size["height"]
    columns = texels = np.zeros(0)
    if light.picture is not None:
        columns, texels = 0.5 - light.picture.lines(1)[::-1], 0.5 - light.picture.lines(0)[::-1]

    def edges(p: Doubles) -> Doubles:
        return _edges(*_foot(p - light.origin, a, b), -0.5, 0.5, columns)

    lines = Lines(
        lambda u: light.origin + u[..., None] * a,
        b,
        lambda u: (np.full(u.shape, -0.5), np.full(u.shape, 0.5)),
        lambda u: np.broadcast_to(_front(light, a, b), (*u.shape, 3)),
        edges,
        # The picture's first column is at +X, its first row at +Y.
        lambda u, t: (0.5 - u, 0.5 - t),
        texels,
    )
    return under_lines(light, lines, p, n, order, relative)


def _disk(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    """Chords at sin(u): smooth in u to the rim."""
    a, b = light.linear[:, 0] * light.size["radius"], light.linear[:, 1] * light.size["radius"]

    def edges(p: Doubles) -> Doubles:
        return np.arcsin(_edges(*_foot(p - light.origin, a, b), -1, 1))

    lines = Lines(
        lambda u: light.origin + np.sin(u)[..., None] * a,
        b,
        lambda u: (-np.cos(u), np.cos(u)),
        lambda u: np.cos(u)[..., None] * _front(light, a, b),
        edges,
    )
    return under_lines(light, lines, p, n, order, relative)


def _cylinder(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    """Its generators, as far around as the receiver sees them."""
    m, r, half = light.linear, light.size["radius"], light.size["length"] / 2
    inverse = np.linalg.inv(m)
    own = (p - light.origin) @ inverse.T
    away = np.hypot(own[:, 1], own[:, 2]) / r
    reach = np.where(away > 1, np.arctan2(np.sqrt(np.maximum((away - 1) * (away + 1), 0)), 1.0), 0.0)
    middle = np.arctan2(own[:, 2], own[:, 1])
    cofactor = abs(np.linalg.det(m)) * inverse.T

    def around(u: Doubles) -> Doubles:
        return np.stack([np.zeros(u.shape), np.cos(u), np.sin(u)], axis=-1)

    lines = Lines(
        lambda u: light.origin + r * around(u) @ m.T,
        m[:, 0],
        lambda u: (np.full(u.shape, -half), np.full(u.shape, half)),
        lambda u: r * around(u) @ cofactor.T,
        lambda p: np.stack([middle - reach, middle, middle + reach], axis=-1),
    )
    return under_lines(light, lines, p, n, order, relative)


def _mesh(light: Emitter, p: Doubles, n: Doubles, order: int, relative: float) -> Integral:
    value, error = np.zeros((p.shape[0], 1)), np.zeros(p.shape[0])
    sign = np.sign(np.linalg.det(light.linear))
    for corners in light.triangles:
        v0, v1, v2 = corners @ light.linear.T + light.origin
        one = _triangle(light, v0, v1 - v0, v2 - v0, sign * np.cross(v1 - v0, v2 - v0), p, n, order, relative)
        value, error = value + one.value, error + one.error
    return Integral(value, error)


def _triangle(
    light: Emitter, o: Doubles, a: Doubles, b: Doubles, area: Doubles, p: Doubles, n: Doubles, order: int, relative: float
) -> Integral:
    lines = Lines(
        lambda u: o + u[..., None] * a,
        b,
        lambda u: (np.zeros(u.shape), 1 - u),
        lambda u: np.broadcast_to(area, (*u.shape, 3)),
        lambda p: _edges(*_foot(p - o, a, b), 0, 1),
    )
    return under_lines(light, lines, p, n, order, relative)


def _front(light: Emitter, a: Doubles, b: Doubles) -> Doubles:
    """Area vector of the side towards which -Z of the light lies, mirrored or not."""
    v = np.cross(a, b)
    return -v if v @ light.linear[:, 2] > 0 else v


def _foot(d: Doubles, a: Doubles, b: Doubles) -> tuple[Doubles, Doubles]:
    """The coordinate along a of what is nearest to d in the plane of a and b, and d's distance from the plane by |a|."""
    gram = np.array([[a @ a, a @ b], [a @ b, b @ b]])
    along = np.linalg.solve(gram, np.stack([d @ a, d @ b]))
    away = d - along[0][:, None] * a - along[1][:, None] * b
    return along[0], np.linalg.norm(away, axis=-1) / np.linalg.norm(a)


def _edges(foot: Doubles, away: Doubles, low: float, high: float, more: Doubles = np.zeros(0)) -> Doubles:  # noqa: B008
    """low to high, cut at `more` and, in growing steps, on both sides of the foot."""
    steps = np.concatenate([-_STEPS[::-1], [0], _STEPS])
    cuts = np.clip(foot[:, None] + np.maximum(away, 1e-9)[:, None] * steps, low, high)
    fixed = np.broadcast_to(np.concatenate([[low, high], more]), (foot.size, 2 + more.size))
    return np.sort(np.concatenate([fixed, cuts], axis=1), axis=1)


_STEPS = 6.0 ** np.arange(0, 10)

_PARTS = {
    "Distant": _distant,
    "Dome": _dome,
    "Sphere": _sphere,
    "Disk": _disk,
    "Rect": _rect,
    "Cylinder": _cylinder,
    "Mesh": _mesh,
}
