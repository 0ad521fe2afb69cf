"""Stereo pairs of cameras: UsdGeomCamera's stereoRole says which eye a camera is, but not which two belong together.

The pair is searched among the siblings of the chosen camera, then among its descendants, then on the whole stage. The first of
these with both roles decides, and must have exactly one camera of each. A chosen camera that has a role is part of the pair.
"""

from __future__ import annotations

from pxr import Usd

from ...errors import SettingsError
from ...settings import Eye
from ..stage.values import When, token

NAMED = 10  # cameras in a message


def stereo_role(camera: Usd.Prim, when: When) -> str:
    return token(camera, "stereoRole", when, "mono")


def eye_of_pair(chosen: Usd.Prim | None, cameras: list[Usd.Prim], eye: Eye, when: When) -> Usd.Prim:
    """Return the camera of that eye in the pair of `chosen`; SettingsError if there is no pair, or more than one."""
    wanted = {role.value: _of_role(chosen, cameras, role.value, when) for role in Eye}
    for place in _places(chosen, cameras):
        pair = {role: [camera for camera in place if camera in found] for role, found in wanted.items()}
        if all(len(found) == 1 for found in pair.values()):
            return pair[eye.value][0]
        if all(pair.values()):
            raise _several(chosen, pair)
    raise _none(chosen, cameras, when)


def _of_role(chosen: Usd.Prim | None, cameras: list[Usd.Prim], role: str, when: When) -> list[Usd.Prim]:
    if chosen is not None and stereo_role(chosen, when) == role:
        return [chosen]
    return [camera for camera in cameras if stereo_role(camera, when) == role]


def _places(chosen: Usd.Prim | None, cameras: list[Usd.Prim]) -> list[list[Usd.Prim]]:
    if chosen is None:
        return [cameras]
    path, beside = chosen.GetPath(), chosen.GetPath().GetParentPath()
    siblings = [camera for camera in cameras if camera.GetPath().GetParentPath() == beside]
    below = [camera for camera in cameras if camera.GetPath().HasPrefix(path)]
    return [siblings, below, cameras]


def _several(chosen: Usd.Prim | None, pair: dict[str, list[Usd.Prim]]) -> SettingsError:
    listed = "; ".join(f"{role}: {', '.join(str(c.GetPath()) for c in found[:NAMED])}" for role, found in pair.items())
    sentence = f"several cameras could form the stereo pair ({listed}): choose one eye with --camera"
    return SettingsError(sentence, where=_where(chosen), code="stereo-ambiguous")


def _none(chosen: Usd.Prim | None, cameras: list[Usd.Prim], when: When) -> SettingsError:
    listed = ", ".join(f"{c.GetPath()} ({stereo_role(c, when)})" for c in cameras[:NAMED]) or "none"
    sentence = f"no two cameras form a pair with the stereoRoles left and right; the stage's cameras: {listed}"
    return SettingsError(sentence, where=_where(chosen), code="stereo-pair")


def _where(chosen: Usd.Prim | None) -> str:
    return "eye" if chosen is None else str(chosen.GetPath())
