"""Cases of ShapingAPI: cones, focus and photometric files, on every shape of light and under every kind of transform."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.reference.cases.plane_cases import ABOVE, FLAT, MIRROR, SHEAR, STANDING, STRETCH, Case, at
from tests.reference.cases.profiles import (
    fine_profile,
    half_profile,
    ninety_profile,
    quadrant_profile,
    spot_profile,
    type_a_profile,
    type_b_profile,
    uneven_profile,
)
from tests.reference.stages import rotation, translation

SHAPES: dict[str, dict[str, Any]] = {
    "SphereLight": {"radius": 0.4},
    "DiskLight": {"radius": 0.6},
    "RectLight": {"width": 1.2, "height": 0.7},
    "CylinderLight": {"radius": 0.25, "length": 1.2},
}
API = ["ShapingAPI"]
ANGLE, SOFT = "ShapingAPI.inputs:shaping:cone:angle", "ShapingAPI.inputs:shaping:cone:softness"
FOCUS, TINT = "ShapingAPI.inputs:shaping:focus", "ShapingAPI.inputs:shaping:focusTint"
FILE, SCALE = "ShapingAPI.inputs:shaping:ies:file", "ShapingAPI.inputs:shaping:ies:angleScale"
NORMALIZE = "ShapingAPI.inputs:shaping:ies:normalize"
# Its back is towards the plane.
BACKWARD = translation(0.3, 1.4, -0.4) @ rotation([1, 0.2, 0.3], 70)
# Along the plane, a little downwards.
SIDEWAYS = translation(0.3, 1.4, -0.4) @ rotation([1, 0.2, 0.3], -15)
SKEW = ABOVE @ STRETCH @ SHEAR


def cone(angle: float, softness: float = 0.0) -> list[str]:
    return [f"float inputs:shaping:cone:angle = {angle}", f"float inputs:shaping:cone:softness = {softness}"]


def focus(power: float, tint: str = "") -> list[str]:
    colored = [f"color3f inputs:shaping:focusTint = {tint}"] if tint else []
    return [f"float inputs:shaping:focus = {power}", *colored]


def wide() -> list[str]:
    """No cone: the schema's is 90 degrees."""
    return cone(180)


def shaped(
    name: str, kind: str, m: np.ndarray, lines: list[str], *rows: str, spp: int = 1024, times: int = 16, **more: Any
) -> Case:
    return at("Shaping", f"{kind.removesuffix('Light')}, {name}", kind, m, *rows, lines=lines, apis=API, spp=spp, times=times,
              **{**SHAPES[kind], **more})  # fmt: skip


def cone_cases() -> list[Case]:
    made = []
    for kind in SHAPES:
        made += [
            shaped("cone 35", kind, ABOVE, cone(35), ANGLE, quick=kind == "RectLight"),
            shaped("cone 40, softness 0.7", kind, ABOVE, cone(40, 0.7), ANGLE, SOFT, quick=kind == "DiskLight"),
            shaped("cone 30, stretched, sheared, normalize", kind, SKEW, cone(30, 0.2), ANGLE, SOFT, normalize=True),
        ]
    for kind in ("SphereLight", "CylinderLight"):
        made += [
            shaped("default cone", kind, ABOVE, [], ANGLE),
            shaped("default cone, from the side", kind, SIDEWAYS, [], ANGLE),
            shaped("cone 130, softness 0.5, from behind", kind, BACKWARD, cone(130, 0.5), ANGLE, SOFT),
            shaped("cone 180, from behind", kind, BACKWARD, cone(180), ANGLE),
        ]
    point = ["bool treatAsPoint = true", *cone(40, 0.5)]
    return [
        *made,
        shaped("softness 1.7 is 1", "SphereLight", ABOVE, cone(60, 1.7), SOFT),
        shaped("softness -0.5 is 0", "SphereLight", ABOVE, cone(40, -0.5), SOFT),
        shaped("treatAsPoint, cone 40, softness 0.5", "SphereLight", ABOVE, point, ANGLE, SOFT, normalize=True, intensity=4.0),
        shaped("cone 3", "DiskLight", translation(0, 5, 0) @ FLAT, cone(3), ANGLE, times=256),
        shaped("mirrored, cone 30", "RectLight", ABOVE @ MIRROR @ SHEAR, cone(30, 0.4), ANGLE),
        shaped(
            "upright, cone 60, softness 0.5",
            "CylinderLight",
            translation(0, 1.2, 0) @ STANDING,
            cone(60, 0.5),
            ANGLE,
            times=128,
        ),
    ]


def focus_cases() -> list[Case]:
    tint = "(0.1, 0.6, 1)"
    made = [
        shaped("focus 3, tint", kind, ABOVE, [*wide(), *focus(3, tint)], FOCUS, TINT, quick=kind == "SphereLight")
        for kind in SHAPES
    ]
    made += [shaped("focus 2, sheared: the axis, not the normal", k, SKEW, [*wide(), *focus(2)], FOCUS) for k in SHAPES]
    return [
        *made,
        shaped("focus 2, from behind", "SphereLight", BACKWARD, [*wide(), *focus(2)], FOCUS),
        shaped("focus 2, from behind", "CylinderLight", BACKWARD, [*wide(), *focus(2)], FOCUS),
        shaped("focus -2 is ignored", "RectLight", ABOVE, [*wide(), *focus(-2)], FOCUS),
        shaped("focus 0.3, cone 70", "CylinderLight", ABOVE, [*cone(70, 0.3), *focus(0.3, tint)], FOCUS, TINT, ANGLE, SOFT),
        shaped("focus 400", "DiskLight", translation(0, 3, 0) @ FLAT, focus(400), FOCUS, times=192),
    ]


QUICK = ("profile, treatAsPoint", "profile, type A", "profile, type B", "profile, angleScale 1.4")


def profile_cases() -> list[Case]:
    files = {
        "uneven.ies": uneven_profile(), "spot.ies": spot_profile(), "quadrant.ies": quadrant_profile(),
        "half.ies": half_profile(), "fine.ies": fine_profile(), "ninety.ies": ninety_profile(),
        "a.ies": type_a_profile(), "b.ies": type_b_profile(),
    }  # fmt: skip

    def lit(name: str, kind: str, m: np.ndarray, file: str, *rows: str, scale: float = 0.0, more: list[str] | None = None,
            **values: Any) -> Case:  # fmt: skip
        lines = [*(more or wide()), f"asset inputs:shaping:ies:file = @ASSETS/{file}.ies@"]
        if scale:
            lines.append(f"float inputs:shaping:ies:angleScale = {scale}")
        values.setdefault("quick", name in QUICK)  # the others take the referee five seconds and more
        return shaped(name, kind, m, lines, FILE, *rows, spp=2048, assets={f"{file}.ies": files[f"{file}.ies"]}, **values)

    back = ["bool inputs:shaping:ies:normalize = true", *wide()]
    return [
        *(lit("profile", kind, ABOVE, "uneven", quick=kind == "DiskLight") for kind in SHAPES),
        *(lit("profile, stretched, sheared, mirrored", kind, SKEW @ MIRROR, "uneven") for kind in SHAPES),
        lit("profile, from behind", "SphereLight", BACKWARD, "uneven"),
        lit("profile, spot", "RectLight", ABOVE, "spot"),
        lit("profile, one quadrant", "DiskLight", ABOVE, "quadrant"),
        lit("profile, half", "SphereLight", ABOVE @ rotation([0, 0, 1], 40), "half"),
        lit("profile, planes 90 to 270", "SphereLight", ABOVE @ rotation([0, 0, 1], 40), "ninety"),
        lit("profile, type A", "RectLight", ABOVE @ rotation([0, 0, 1], 40), "a"),
        lit("profile, type B", "RectLight", ABOVE @ rotation([0, 0, 1], 40), "b"),
        lit("profile, angleScale 0.5", "RectLight", ABOVE, "spot", SCALE, scale=0.5, times=64),
        lit("profile, angleScale 1.4", "RectLight", ABOVE, "spot", SCALE, scale=1.4),
        lit("profile, angleScale -0.7", "SphereLight", ABOVE, "uneven", SCALE, scale=-0.7, times=32),
        lit("profile, angleScale -1.6", "SphereLight", BACKWARD, "uneven", SCALE, scale=-1.6),
        lit("profile, normalize", "SphereLight", ABOVE, "fine", NORMALIZE, more=back),
        lit("profile, normalize, a hemisphere", "DiskLight", ABOVE, "spot", NORMALIZE, more=back),
        lit("profile, cone, focus, tint", "CylinderLight", ABOVE, "uneven", FOCUS, TINT, ANGLE, SOFT,
            more=[*cone(60, 0.5), *focus(1.5, "(0, 0.5, 1)")]),
        lit("profile, treatAsPoint", "SphereLight", ABOVE, "uneven", more=["bool treatAsPoint = true", *wide()],
            normalize=True),
    ]  # fmt: skip


def shaped_cases() -> list[Case]:
    return [*cone_cases(), *focus_cases(), *profile_cases()]
