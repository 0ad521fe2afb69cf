"""UsdLux's ShapingAPI in double precision, written from the schema's text alone, for the tests to compare the core with."""

from __future__ import annotations

import math

import numpy as np

from primray.description import Doubles, IesProfile, Light


def shaped(x: Light, e: Doubles) -> Doubles:
    """focusTerm * coneTerm * iesTerm of a light for unit directions of emission (N, 3) in the world: (N, 3)."""
    s = x.shaping
    assert s is not None
    axis = -x.world_from_light[:3, 2] / np.linalg.norm(x.world_from_light[:3, 2])
    cosine = np.clip(e @ axis, -1, 1)
    result = np.ones((len(e), 3))
    if s.focus > 0:
        focus_factor = np.abs(cosine) ** s.focus
        result *= (1 - focus_factor[:, None]) * np.array(s.focus_tint) + focus_factor[:, None]
    theta, cutoff = np.arccos(cosine), math.radians(s.cone_angle_deg)
    start = cutoff * (1 - min(max(s.cone_softness, 0), 1))
    t = np.clip((theta - start) / (cutoff - start), 0, 1) if cutoff > start else (theta > cutoff).astype(float)
    result *= np.where(theta > cutoff, 0, 1 - t * t * (3 - 2 * t))[:, None]
    if s.ies is not None:
        local = e @ np.linalg.inv(x.world_from_light[:3, :3]).T
        local /= np.linalg.norm(local, axis=1)[:, None]
        theta, a = np.arccos(np.clip(-local[:, 2], -1, 1)), s.ies_angle_scale
        theta_ies = theta / a if a > 0 else theta if a == 0 else (theta - math.pi) / -a + math.pi
        phi = np.arctan2(-local[:, 1], -local[:, 0])
        value = intensity(s.ies, np.minimum(theta_ies, math.pi), phi)
        result *= (value / (s.ies.power if s.ies_normalize else 1))[:, None]
    return result


def intensity(profile: IesProfile, theta: Doubles, phi: Doubles) -> Doubles:
    """Bilinear between the profile's angles, 0 outside them; theta from -Z, phi from -X towards -Y."""
    v, h = np.degrees(theta), np.degrees(phi) % 360
    if profile.horizontal_pole:
        d = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)], axis=1)
        v, h = np.degrees(np.arctan2(d[:, 0], -d[:, 2])), np.degrees(np.arcsin(np.clip(-d[:, 1], -1, 1)))
    i, fv, inside_v = cell(np.asarray(profile.vertical_deg, np.float64), v)
    if len(profile.horizontal_deg) == 1:
        c = profile.candela[0].astype(np.float64)
        value, inside_h = c[i] * (1 - fv) + c[i + 1] * fv, np.ones(len(v), bool)
    else:
        j, fh, inside_h = cell(np.asarray(profile.horizontal_deg, np.float64), h)
        c2 = profile.candela.astype(np.float64)
        low, high = c2[j, i] * (1 - fv) + c2[j, i + 1] * fv, c2[j + 1, i] * (1 - fv) + c2[j + 1, i + 1] * fv
        value = low * (1 - fh) + high * fh
    return np.where(inside_v & inside_h & (theta >= 0), value, 0.0)


def cell(angles: Doubles, x: Doubles) -> tuple[np.ndarray, Doubles, np.ndarray]:
    i = np.clip(np.searchsorted(angles, x, side="right") - 1, 0, len(angles) - 2)
    width = angles[i + 1] - angles[i]
    part = np.clip((x - angles[i]) / np.where(width > 0, width, 1), 0, 1)
    return i, part, (x >= angles[0]) & (x <= angles[-1])
