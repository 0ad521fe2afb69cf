"""Lidars on a stage: which prims are one, what is authored of their patterns, and where they are at given times.

Attributes `primray:lidar:...` (PrimrayLidarAPI, schemas/usd) are read from any prim, applied or not; `omni:sensor:Core:...` are
those of Omniverse's OmniLidar prims. Names in the own namespace that the schema does not have are reported.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from ...arrays import Doubles
from ...diagnostics import Diagnostics
from ...errors import InvalidSceneError, SettingsError, did_you_mean
from ..motion.attributes import bend_times, is_animated
from ..motion.timing import Timing
from ..scene.inheritance import transforms, world_matrix
from ..stage.metadata import meters_per_unit, time_codes_per_second
from ..stage.reads import local_transform, property_names, type_name
from ..stage.traversal import world_prims
from ..stage.values import When, matrix, read, when_of

OWN, OMNIVERSE = "primray:lidar:", "omni:sensor:Core:"
OMNI_LIDAR = "OmniLidar"
EMITTERS = f"{OMNIVERSE}emitterState:s001:"
# Attributes of PrimrayLidarAPI by the members of a pattern that they are.
WORDS = {
    "pattern": "pattern",
    "table": "table",
    "elevations": "elevations",
    "azimuths": "azimuths",
    "times": "times",
    "channelNumbers": "channel_numbers",
    "channels": "channels",
    "elevationRange": "elevation_range",
    "steps": "steps",
    "sweep": "sweep",
    "clockwise": "clockwise",
    "rate": "rate",
    "range": "range",
}
MOST_POSES = 4096  # of a moving sensor in one frame; between them it moves in a straight line
# From a camera's axes (x right, y up, z backward) to a lidar's (x forward, y left, z up).
CAMERA_FROM_LIDAR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class LidarPrim:
    """A prim that lidar rays start from, and what is authored of its pattern, by members of a pattern's JSON."""

    path: str
    authored: Mapping[str, Any]


def lidar_prims(stage: Usd.Stage) -> list[str]:
    """Return the paths of all prims that say something of a lidar."""
    return [str(prim.GetPath()) for prim in world_prims(stage) if _is_lidar(prim)]


def _is_lidar(prim: Usd.Prim) -> bool:
    return type_name(prim) == OMNI_LIDAR or any(name.startswith((OWN, OMNIVERSE)) for name in property_names(prim))


def lidar_prim(stage: Usd.Stage, path: str | None, time_code: float | None, diagnostics: Diagnostics) -> LidarPrim:
    """Return the prim at a path, or with this name if it is unique; None: the only lidar of the stage.

    SettingsError `lidar-sensor` if there is no such prim, or more than one.
    """
    known = lidar_prims(stage)
    if path is None:
        if len(known) != 1:
            found = (
                f"the stage has {len(known)}: {', '.join(known[:5])}" if known else "no prim of the stage says that it is one"
            )
            raise SettingsError(f"name the lidar's prim; {found}", where="sensor", code="lidar-sensor")
        path = known[0]
    prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) and path.startswith("/") else None
    if not prim:
        named = [each for each in world_prims(stage) if each.GetName() == path]
        if len(named) != 1:
            hint = did_you_mean(path, known) or (
                f"lidars are {', '.join(known[:5])}" if known else "no prim has lidar attributes"
            )
            count = f"{len(named)} prims are named" if named else "there is no prim"
            raise SettingsError(f"{count} {path!r}; {hint}", where="sensor", code="lidar-sensor")
        prim = named[0]
    if not prim.IsA(UsdGeom.Xformable) and type_name(prim) != OMNI_LIDAR:
        sentence = (
            f"a {type_name(prim) or 'prim without a type'} has no place: a lidar is an Xform, a Camera or another Xformable"
        )
        raise SettingsError(sentence, where=str(prim.GetPath()), code="lidar-sensor")
    return LidarPrim(str(prim.GetPath()), _authored(prim, when_of(stage, time_code), diagnostics))


def _authored(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> dict[str, Any]:
    found: dict[str, Any] = {}
    names = [name for name in property_names(prim) if name.startswith(OWN)]
    for name in names:
        word = name.removeprefix(OWN)
        if word not in WORDS:
            hint = did_you_mean(word, WORDS)
            message = f"{name} is not known{f': {hint}' if hint else ''}; it is ignored."
            diagnostics.add("camera-input", str(prim.GetPath()), message, name)
        elif (value := read(prim, name, when)) is not None:
            found[WORDS[word]] = _plain(value)
    if not names and (type_name(prim) == OMNI_LIDAR or any(n.startswith(OMNIVERSE) for n in property_names(prim))):
        return dict(_of_omniverse(prim, when, diagnostics))
    return found


def _plain(value: Any) -> Any:
    """Return a value of USD as JSON has it; assets are paths that are resolved where they can be."""
    if isinstance(value, Sdf.AssetPath):
        return value.resolvedPath or value.path
    if isinstance(value, bool | int | float | str):
        return value
    return np.asarray(value).tolist()


def _of_omniverse(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Iterator[tuple[str, Any]]:
    """Yield the members of a pattern that OmniSensorGenericLidarCoreAPI says, as NVIDIA's documentation of ovrtx describes it.

    The number of emitters is that of the arrays' values; what `numberOfEmitters` says is reported where it differs.
    """

    def get(name: str, default: Any) -> Any:
        value = read(prim, OMNIVERSE + name, when)
        return default if value is None else _plain(value)

    arrays = {name: read(prim, EMITTERS + name, when) for name in ("elevationDeg", "azimuthDeg", "fireTimeNs", "channelId")}
    lists = {name: np.asarray(value).tolist() for name, value in arrays.items() if value is not None and len(value)}
    count = len(lists.get("elevationDeg", ()))
    said = get("numberOfEmitters", count)
    if said != count:
        message = f"numberOfEmitters is {said}, and emitterState has {count}: those are taken."
        diagnostics.add("camera-input", str(prim.GetPath()), message, f"{OMNIVERSE}numberOfEmitters")
    yield "elevations", lists.get("elevationDeg", [0.0])
    if "azimuthDeg" in lists:
        yield "azimuths", lists["azimuthDeg"]
    if "fireTimeNs" in lists:
        yield "times", [1e-9 * time for time in lists["fireTimeNs"]]
    if "channelId" in lists:
        yield "channel_numbers", lists["channelId"]
    rate = float(get("scanRateBaseHz", 10.0))
    yield "rate", rate
    yield "range", [float(get("nearRangeM", 0.3)), float(get("farRangeM", 200.0))]
    start = float(get("startAzimuthOffsetDeg", 0.0))
    if get("scanType", "ROTARY") == "ROTARY":
        firing = float(get("patternFiringRateHz", get("reportRateBaseHz", 36000.0)))
        yield "steps", max(1, round(firing / rate)) if rate > 0 else 1
        first, last = float(get("validStartAzimuthDeg", 0.0)), float(get("validEndAzimuthDeg", 360.0))
        yield "sweep", [start + first, start + last]
        yield "clockwise", get("rotationDirection", "CW") == "CW"
    else:
        yield "steps", 1


def lidar_poses(stage: Usd.Stage, path: str, time_code: float | None, seconds: Doubles) -> tuple[Doubles, Doubles]:
    """Return the times (K), ascending, in seconds after the frame, and world_from_lidar (K, 4, 4) at each: rigid, scene units.

    A sensor that stands still has one; one that moves has as many as there are different times, up to MOST_POSES, beyond which
    these are even times and those of authored samples. A lidar has x forward, y left, z up: those of a prim, but a Camera's x
    is its view, and z its up.
    """
    prim = stage.GetPrimAtPath(path)
    when, codes = when_of(stage, time_code), time_codes_per_second(stage)
    times = np.unique(seconds)
    timing = Timing(opens=float(times[0]) * codes, closes=float(times[-1]) * codes, is_timed=True)
    moving = [attribute for attribute in _transforms_of(prim) if is_animated(attribute, when, timing)]
    if not moving or len(times) < 2:
        return times[:1], _pose(prim, when.after(float(times[0]) * codes))[None]
    if len(times) > MOST_POSES:
        bends = [offset / codes for offset in bend_times(moving, when, timing)]
        inner = [time for time in bends if times[0] < time < times[-1]]
        times = np.unique(np.concatenate([np.linspace(times[0], times[-1], MOST_POSES), inner]))
    return times, np.stack([_pose(prim, when.after(float(time) * codes)) for time in times])


def _transforms_of(prim: Usd.Prim) -> Iterator[Usd.Attribute]:
    while prim and not prim.IsPseudoRoot():
        yield from (prim.GetAttribute(name) for name in property_names(prim) if name.startswith("xformOp:"))
        prim = prim.GetParent()


def _pose(prim: Usd.Prim, when: When) -> Doubles:
    gf = world_matrix(prim, when, transforms(when))
    if not prim.IsA(UsdGeom.Xformable):  # a type that USD does not know has transforms all the same
        gf = _local_of_unknown(prim, when) * gf
    world = matrix(gf)
    if not np.isfinite(world).all() or abs(np.linalg.det(world[:3, :3])) < 1e-300:
        raise InvalidSceneError("its transform has no inverse", where=str(prim.GetPath()), code="lidar-sensor")
    rigid = gf.RemoveScaleShear()
    rigid.Orthonormalize()
    pose = matrix(rigid)
    if type_name(prim) == "Camera":
        pose[:3, :3] = pose[:3, :3] @ CAMERA_FROM_LIDAR
    return pose


def _local_of_unknown(prim: Usd.Prim, when: When) -> Gf.Matrix4d:
    """Return the transform that the attributes of a prim say as those of an Xform."""
    stage = Usd.Stage.CreateInMemory()
    made = UsdGeom.Xform.Define(stage, "/xform").GetPrim()
    for name in property_names(prim):
        if name.startswith("xformOp") and (found := read(prim, name, when)) is not None:
            made.CreateAttribute(name, prim.GetAttribute(name).GetTypeName()).Set(found)
    return local_transform(UsdGeom.XformCache(), made)[0]


def lidar_units(stage: Usd.Stage) -> tuple[float, float]:
    """Return metres per scene unit, and time codes per second."""
    return meters_per_unit(stage), time_codes_per_second(stage)
