# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a stage that stays open for a viewport, in the Python that has primray.

Reads changes, lines of JSON: a stage to open or to follow, edits of places, a camera, a size, settings. Answers by pictures: a
draft, then refining ones, until the next change. Pixels are handed over as by `renderer.py`. The end of stdin ends the process.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from renderer import Pixels, say

CAMERA = "/root/_primray/viewport"
# A draft has some 48,000 pixels of two samples each; pictures refine twice a second.
DRAFT_PIXELS, DRAFT_SAMPLES = 48_000, 2
EVERY_S = 0.5
LOOK_SAMPLES = 4  # of the first whole picture


class Inbox:
    """Changes that have arrived and not been taken; `has_news` ends a render in progress."""

    def __init__(self) -> None:
        self._changes: list[dict[str, Any]] = []
        self._news = threading.Condition()

    def listen(self) -> None:
        for line in sys.stdin:
            with self._news:
                self._changes.append(json.loads(line))
                self._news.notify()
        os._exit(0)  # whoever asked is gone

    @property
    def has_news(self) -> bool:
        return bool(self._changes)

    def take(self) -> list[dict[str, Any]]:
        with self._news:
            self._news.wait_for(lambda: bool(self._changes))
            found, self._changes = self._changes, []
        return found


class KeptStage:
    """A stage in memory that follows exported ones: of each export only what differs is written into it."""

    def __init__(self) -> None:
        from pxr import Sdf, Usd

        self.stage: Any = None
        self._root, self._shapes, self._view = (
            Sdf.Layer.CreateAnonymous(f"{name}.usdc") for name in ("scene", "shapes", "view")
        )
        self._stage_type = Usd.Stage

    def follow(self, file: str) -> None:
        """Let the stage be as an exported one, which has one sublayer."""
        from pxr import Sdf, UsdUtils

        root = Sdf.Layer.FindOrOpen(file)
        shapes = Sdf.Layer.FindOrOpen(root.ComputeAbsolutePath(root.subLayerPaths[0]))
        for source, target in ((shapes, self._shapes), (root, self._root)):
            here = Sdf.Layer.CreateAnonymous(".usdc")
            here.TransferContent(source)
            here.subLayerPaths = []
            UsdUtils.ModifyAssetPaths(here, lambda path, source=source: source.ComputeAbsolutePath(path) if path else path)
            if self.stage is None:
                target.TransferContent(here)
            else:
                with Sdf.ChangeBlock():
                    follow(here, target)
        if self.stage is None:
            self._root.subLayerPaths = [self._view.identifier, self._shapes.identifier]
            self.stage = self._stage_type.Open(self._root)

    def place(self, path: str, rows: list[list[float]]) -> None:
        """Write a transform where the stage has it."""
        from pxr import Gf, Sdf

        for layer in (self._root, self._shapes):
            attribute = layer.GetAttributeAtPath(Sdf.Path(path).AppendProperty("xformOp:transform"))
            if attribute is not None:
                attribute.default = Gf.Matrix4d(rows)
                return

    def look(self, camera: dict[str, Any]) -> None:
        from pxr import Usd

        with Usd.EditContext(self.stage, self._view):
            write_camera(self.stage, CAMERA, camera)


def write_camera(stage: Any, path: str, camera: dict[str, Any]) -> None:
    """Write the camera that a viewport looks by, as `viewport.camera_of` describes it."""
    from pxr import Gf, Sdf, UsdGeom

    found = UsdGeom.Camera.Get(stage, path)
    if not found:
        found = UsdGeom.Camera.Define(stage, path)
        found.AddTransformOp()
    found.GetOrderedXformOps()[0].Set(Gf.Matrix4d(camera["rows"]))
    values = (
        (found.CreateProjectionAttr(), camera["projection"]), (found.CreateClippingRangeAttr(), Gf.Vec2f(*camera["clip"])),
        (found.CreateHorizontalApertureAttr(), camera["size"][0]), (found.CreateVerticalApertureAttr(), camera["size"][1]),
        (found.CreateHorizontalApertureOffsetAttr(), camera["offset"][0]),
        (found.CreateVerticalApertureOffsetAttr(), camera["offset"][1]), (found.CreateFocalLengthAttr(), camera["focal"]),
        (found.CreateFStopAttr(), camera["fstop"]), (found.CreateFocusDistanceAttr(), camera["focus"]),
    )  # fmt: skip
    for attribute, value in values:
        attribute.Set(value)
    found.GetPrim().CreateAttribute("primray:nearest", Sdf.ValueTypeNames.Double).Set(camera["nearest"])


def follow(source: Any, target: Any) -> None:
    """Let a layer be as another one, by as few edits as that takes."""
    _follow_info(source.pseudoRoot, target.pseudoRoot)
    _follow_children(source.pseudoRoot, target.pseudoRoot)


def _follow_children(source: Any, target: Any) -> None:
    """Let prims below `target` be as those below `source`."""
    from pxr import Sdf

    names = [child.name for child in source.nameChildren]
    there = [child.name for child in target.nameChildren]
    for name in set(there) - set(names):
        del target.nameChildren[name]
    if [name for name in there if name in names] + [name for name in names if name not in there] != names:
        # A prim that is copied comes last: to be in order, all come anew.
        for name in list(target.nameChildren.keys()):
            del target.nameChildren[name]
        there = []
    for child in source.nameChildren:
        if child.name in there:
            _follow_prim(child, target.nameChildren[child.name])
        else:
            Sdf.CopySpec(source.layer, child.path, target.layer, child.path)


def _follow_prim(source: Any, target: Any) -> None:
    from pxr import Sdf

    if (source.specifier, source.typeName) != (target.specifier, target.typeName):
        Sdf.CopySpec(source.layer, source.path, target.layer, target.path)
        return
    _follow_info(source, target)
    for name in set(target.properties.keys()) - set(source.properties.keys()):
        target.RemoveProperty(target.properties[name])
    for found in source.properties:
        there = target.properties.get(found.name)
        is_same_kind = there is not None and all(
            found.GetInfo(key) == there.GetInfo(key) for key in ("typeName", "variability", "custom") if found.HasInfo(key)
        )
        if is_same_kind:
            _follow_info(found, there)
        else:
            Sdf.CopySpec(source.layer, found.path, target.layer, found.path)
    _follow_children(source, target)


def _follow_info(source: Any, target: Any) -> None:
    """Let values and metadata be as another spec's."""
    keys = set(source.ListInfoKeys()) - {"subLayers", "subLayerOffsets"}
    for key in set(target.ListInfoKeys()) - keys - {"subLayers", "subLayerOffsets"}:
        target.ClearInfo(key)
    for key in keys:
        value = source.GetInfo(key)
        if not target.HasInfo(key) or target.GetInfo(key) != value:
            target.SetInfo(key, value)


class Renderer:
    """Renders the kept stage as it was last asked to."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox
        self._kept = KeptStage()
        self._scene: Any = None
        self._pixels: Pixels | None = None
        self._edition = 0
        self._size: list[int] | None = None
        self._settings: dict[str, Any] = {}

    def take(self, change: dict[str, Any]) -> None:
        """Take a change; raises PrimrayErrors of stages that cannot be opened."""
        import primray

        if "pixels" in change:
            self._pixels = Pixels(change["pixels"])
        if "open" in change:
            self._kept.follow(change["open"])
            say(opened=change["open"])
            if self._scene is None:
                self._scene = primray.Scene(self._kept.stage)
        for edit in change.get("edits", []):
            self._kept.place(edit["path"], edit["rows"])
        if "camera" in change:
            self._kept.look(change["camera"])
        self._size = change.get("size", self._size)
        self._settings = change.get("settings", self._settings)
        self._edition = change.get("edition", self._edition)

    def render(self) -> None:
        """Render a draft, a first look, and a picture that refines; ends early where a change has arrived."""
        if self._scene is None or self._size is None or self._pixels is None:
            return
        width, height = self._size
        smaller = math.sqrt(width * height / DRAFT_PIXELS)
        if smaller > 1:
            self._picture(DRAFT_SAMPLES, pixel_size=smaller, is_draft=True)
        samples = self._settings.get("samples", 32)
        if samples > LOOK_SAMPLES:
            self._picture(LOOK_SAMPLES, is_draft=True)
        self._picture(samples)

    def _picture(self, samples: int, pixel_size: float = 1.0, is_draft: bool = False) -> None:
        from primray.render.progress import Snapshots

        values = {
            name: self._settings[name] for name in ("seed", "threads", "max_depth") if self._settings.get(name) is not None
        }
        opaque = not self._settings.get("transparent")  # a visible world covers, as in Blender
        start = time.monotonic()

        def show(image: Any, finished: bool) -> None:
            assert self._pixels is not None
            taken = float(image.metadata.get("samples_per_pixel", str(samples)).split()[0]) if not finished else float(samples)
            pixels = (
                image.pixels if not opaque else np.dstack([image.pixels[..., :3], np.ones(image.pixels.shape[:2], np.float32)])
            )
            say(picture=self._pixels.put({"Combined": pixels}), edition=self._edition, samples=taken,
                draft=is_draft, finished=finished and not is_draft, seconds=time.monotonic() - start,
                relmse=_relmse(image) if finished and not is_draft else None)  # fmt: skip

        snapshots = None if is_draft else Snapshots(EVERY_S, lambda so_far: show(so_far, False))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = self._scene.render(
                camera=CAMERA, resolution=tuple(self._size or ()), pixel_size=pixel_size, spp=samples, aovs=[],
                dome_visible=opaque, progress=lambda *_: not self._inbox.has_news, snapshots=snapshots, **values,
            )  # fmt: skip
        show(image, True)


def _relmse(image: Any) -> float | None:
    found = (image.report.get("error") or {}).get("relmse")
    return found.get("estimate") if isinstance(found, dict) else None


def main() -> None:
    inbox = Inbox()
    threading.Thread(target=inbox.listen, daemon=True).start()
    import primray

    renderer = Renderer(inbox)
    say(ready=primray.__version__)
    while True:
        changes = inbox.take()
        # Each change is taken, whatever became of those before it.
        taken = [attempt(partial(renderer.take, change)) for change in changes]
        if all(taken) and not changes[-1].get("stop"):
            attempt(renderer.render)


def attempt(what: Callable[[], None]) -> bool:
    """Return whether something succeeded; says what went wrong, but for renders that a change has ended."""
    import primray

    try:
        what()
    except primray.errors.RenderCancelled:
        pass
    except primray.PrimrayError as error:
        say(error=str(error))
    except Exception as error:
        traceback.print_exc()
        say(error=f"{type(error).__name__}: {error}")
    else:
        return True
    return False


if __name__ == "__main__":
    main()
