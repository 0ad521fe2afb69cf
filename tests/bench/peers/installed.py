"""Which renderers can be compared here. PRIMRAY_PEERS names a folder with a virtual environment for each peer: mi (Mitsuba),
bpy (Cycles) and lux (LuxCore); what is not there is left out."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

ENVIRONMENTS = {"mitsuba": "mi", "cycles": "bpy", "luxcore": "lux"}
PACKAGES = {"mitsuba": "mitsuba", "cycles": "bpy", "luxcore": "pyluxcore"}
OURS = "primray"
DENOISED = "denoised"  # a variant of those that can
MOVING = ("spin", "pan", "swarm", "flag")
BEHIND_GLASS = ("pool", "bulbs", "junk", "metals", "haze")  # light comes through glass or water


@dataclass(frozen=True)
class Renderer:
    name: str  # peer and variant: mitsuba-llvm-multijitter
    peer: str
    variant: str = ""
    scenes: tuple[str, ...] = ()  # that it is meant for; none: all

    @property
    def python(self) -> Path | None:
        """The Python that has it; None if none has."""
        folder = os.environ.get("PRIMRAY_PEERS")
        if self.peer == OURS or not folder:
            return None
        python = Path(folder).resolve() / ENVIRONMENTS[self.peer] / "bin/python"
        return python if python.exists() else None


# Of a peer's variants the first that takes a scene makes its reference.
RENDERERS = (
    Renderer(OURS, OURS),
    *(
        Renderer(f"mitsuba-{variant}", "mitsuba", variant)
        for variant in ("llvm-multijitter", "llvm", "scalar-multijitter", "scalar")
    ),
    Renderer("cycles", "cycles"),
    Renderer("luxcore", "luxcore"),
    *(Renderer(f"luxcore-{variant}", "luxcore", variant, BEHIND_GLASS) for variant in ("bidirectional", "photons")),
)


def meant_for(scene: str) -> list[Renderer]:
    """Return the renderers that a scene is made for, whether or not they are installed and can take it."""
    return [renderer for renderer in RENDERERS if not renderer.scenes or scene in renderer.scenes]


def reason_against(renderer: Renderer, scene: str) -> str | None:
    """Why this renderer cannot take that scene, or what is not to be learnt from it."""
    if scene in MOVING and renderer.peer == "mitsuba":
        return "it has no motion blur"
    if scene in MOVING and renderer.peer == "luxcore":
        return "its runner does not move anything yet"
    if renderer.variant.startswith("llvm") and scene == "field":
        return "it traces every instance while it records its kernel: minutes, and more than 11 GB at 100,000 instances"
    if renderer.variant.startswith("scalar") and scene not in ("field", "box"):
        return "slower than its LLVM variant wherever that takes the scene (box has both)"
    if scene in ("shelf", "flesh", "groom", "pelt") and renderer.peer == "luxcore":
        return "its runner has no such surface"
    if scene == "flesh" and renderer.peer == "mitsuba":
        return "it has no random walk below a surface with an albedo to meet"
    if scene in ("groom", "pelt") and renderer.peer == "mitsuba":
        return "its LLVM variants crashed in three of five runs (3.9.1)"
    return None


def installed(scene: str) -> list[Renderer]:
    return [
        renderer
        for renderer in meant_for(scene)
        if (renderer.peer == OURS or renderer.python is not None) and reason_against(renderer, scene) is None
    ]
