"""Which share of a picture's samples an edit changes: python -m tests.bench.setup.reach_of_edits [SCENE ...].

The gallery's scenes, with five edits of each: something that the camera sees moves, its material changes, a light changes, a
ball is added beside it, and it is deleted. A film that has one sample of each replicate holds single samples, so that their
bits can be compared: no method that keeps the bits can render fewer samples again than those that differ.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from primray import core
from primray.core.passes import pick
from primray.diagnostics import Diagnostics
from primray.render import open_once, prepare
from primray.report.prepared import Prepared
from primray.report.report import Costs
from primray.settings import RenderSettings

GALLERY = Path(__file__).parents[3] / "scenes" / "gallery"
SETTINGS = RenderSettings(resolution=(160, 90), spp=16, threads=1)
INPUTS = ("base_color", "diffuseColor", "color", "subsurface_color", "transmission_color", "specular_ior")

Edit = Callable[[Usd.Stage, str], str]  # returns what it changes


def things_in_view(stage: Usd.Stage) -> Counter[str]:
    """Return the pixels, in a grid of 64 x 36, that show each shape or instance that can be edited where it is."""
    settings = RenderSettings(resolution=(64, 36), spp=2, aovs=("prim", "instance", "material"))
    scene = prepared(stage, settings).scene
    seen: Counter[str] = Counter()
    for y in range(36):
        for x in range(64):
            point = pick(scene, x, y, settings)
            path = "" if point is None else point.instance or point.prim
            if path and Sdf.Path.IsValidPathString(path) and stage.GetPrimAtPath(path).IsA(UsdGeom.Xformable):
                seen[path] += 1
    return seen


def prepared(stage: Usd.Stage, settings: RenderSettings) -> Prepared:
    opened = open_once(stage, settings)
    return prepare(stage, opened.diagnostics, settings, Costs(), Diagnostics())


def bounds(prim: Usd.Prim) -> Gf.Range3d:
    return UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"]).ComputeUntransformedBound(prim).GetRange()


def move(stage: Usd.Stage, thing: str) -> str:
    """Move the thing by a twentieth of its size."""
    prim = stage.GetPrimAtPath(thing)
    by = bounds(prim).GetSize().GetLength() / 20
    UsdGeom.Xformable(prim).AddTranslateOp(opSuffix="edit").Set(Gf.Vec3d(by, 0, 0))
    return thing


def change_material(stage: Usd.Stage, thing: str) -> str:
    """Multiply the first of the inputs that the thing's material authors a value of."""
    for prim in Usd.PrimRange(stage.GetPrimAtPath(thing), Usd.TraverseInstanceProxies()):
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shaders = [p for p in Usd.PrimRange(material.GetPrim()) if p.IsA(UsdShade.Shader)] if material else []
        for attribute in (shader.GetAttribute(f"inputs:{name}") for name in INPUTS for shader in shaders):
            if attribute and attribute.Get() is not None:
                attribute.Set(attribute.Get() * 0.9)
                return str(attribute.GetPath())
    raise ValueError(f"no material of {thing} can be edited")


def change_light(stage: Usd.Stage, thing: str) -> str:
    """Brighten the light in the middle of the list by a tenth."""
    lit = [p for p in stage.Traverse() if p.HasAPI(UsdLux.LightAPI) and not p.IsA(UsdLux.PortalLight)]
    lights = sorted(str(p.GetPath()) for p in lit)
    chosen = lights[len(lights) // 2]
    intensity = UsdLux.LightAPI(stage.GetPrimAtPath(chosen)).CreateIntensityAttr()
    intensity.Set(intensity.Get() * 1.1)
    return chosen


def add(stage: Usd.Stage, thing: str) -> str:
    """Place a ball of a quarter of the thing's size upon it."""
    cache = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"])
    box = cache.ComputeWorldBound(stage.GetPrimAtPath(thing)).ComputeAlignedRange()
    ball = UsdGeom.Sphere.Define(stage, "/added")
    radius = box.GetSize().GetLength() / 8
    ball.CreateRadiusAttr(radius)
    up = Gf.Vec3d(0, 0, 1) if UsdGeom.GetStageUpAxis(stage) == "Z" else Gf.Vec3d(0, 1, 0)
    ball.AddTranslateOp().Set(box.GetMidpoint() + up * (Gf.Dot(box.GetSize(), up) / 2 + radius))
    return "/added"


def delete(stage: Usd.Stage, thing: str) -> str:
    stage.GetPrimAtPath(thing).SetActive(False)
    return thing


EDITS: dict[str, Edit] = {
    "move": move,
    "material": change_material,
    "light": change_light,
    "add": add,
    "delete": delete,
}


def samples_of(made: Prepared) -> tuple[np.ndarray[Any, Any], str]:
    """Return the integers of each sample (samples, R, H, W, values), and what was learnt before the first."""
    scene, settings = made.scene, made.settings
    splits = core.choose_splits(scene, settings)
    guide, caustics = scene.guide(settings, splits), scene.caustics(settings)
    learnt = f"{splits.paths}/{splits.lights}" + " guide" * (guide is not None) + " photons" * (caustics is not None)
    taken = []
    for k in range(settings.most_samples // 2):
        film = core.Film(scene, settings=settings)
        film.start_at(k)
        core.render_pass(scene, film, core.uniform_ends(film, 2 * k + 2), splits, settings)
        state = film.state()
        sums = state["parts"].reshape(*state["parts"].shape[:3], -1)
        taken.append(np.concatenate([sums, state["bins"], state["covered"][..., None]], axis=-1))
    return np.array(taken), learnt


def share(differs: np.ndarray[Any, Any]) -> str:
    return f"{100 * differs.mean():.1f} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=sorted(p.name for p in GALLERY.iterdir() if (p / "scene.usda").exists()))
    parser.add_argument("--rank", type=float, default=0.5, help="of the thing among those in view, the largest first (0.5)")
    parser.add_argument("--keep-learnt", action="store_true", help="splits, guides and photons are those of before the edit")
    asked = parser.parse_args()
    print("| scene | edit | of | learnt before, after | samples that differ | pixels | tiles |\n|---|---|---|---|---|---|---|")
    for name in asked.scenes:
        path = str(GALLERY / name / "scene.usda")
        seen = things_in_view(Usd.Stage.Open(path)).most_common()
        thing = seen[int(asked.rank * len(seen))][0]
        original = prepared(Usd.Stage.Open(path), SETTINGS)
        before, learnt_before = samples_of(original)
        for kind, edit in EDITS.items():
            stage = Usd.Stage.Open(path)
            stage.SetEditTarget(stage.GetSessionLayer())
            what = edit(stage, thing)
            edited = prepared(stage, SETTINGS)
            if asked.keep_learnt:
                for learnt in ("_splits", "_guides", "_caustics"):
                    setattr(edited.scene, learnt, getattr(original.scene, learnt))
            after, learnt_after = samples_of(edited)
            differ = (before != after).any(axis=-1)
            pixels = differ.any(axis=(0, 1))
            tiles = np.logical_or.reduceat(np.logical_or.reduceat(pixels, range(0, 90, 16), 0), range(0, 160, 16), 1)
            shares = f"{share(differ)} | {share(pixels)} | {share(tiles)}"
            print(f"| {name} | {kind} | `{what}` | {learnt_before}, {learnt_after} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
