"""A stage kept open to be rendered repeatedly: with other cameras, times, lights and variants, and after its files changed.

A move of the camera is one attribute of the session layer: everything that does not depend on it is kept between renders.

What takes long is prepared in a thread of its own, as another scene of the same translation, which then takes the place of the
one that is looked at. At first that is a sketch of a heavy scene: without textures, and diced coarsely. Later it has the points
and triangles for where the camera was when it was prepared, so that no move makes them again.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import usd
from ..aovs import LIGHTS
from ..arrays import Doubles
from ..camera import Camera
from ..core.single_precision import rebasing_origin
from ..description.geometry import NurbsPatch, Ribbons, SubdivisionMesh
from ..description.placement import Box
from ..description.shading import without_images
from ..diagnostics import Diagnostics
from ..errors import SettingsError
from ..incremental.scene import KeptStage
from ..incremental.steps import CachedSteps
from ..render.progress import picture_so_far
from ..render.render import picture_of
from ..report.report import Costs
from ..settings import RenderSettings
from . import pixel_explainer
from .lights import lights_so_far
from .orbit import Orbit, orbit_of
from .pixel_explainer import Explanation, PixelExplainer

if TYPE_CHECKING:
    from ..core import compiled
    from ..denoising.denoised import Denoising
    from ..description import SceneDescription
    from ..images.image import Image
    from ..report.prepared import Prepared
    from ..sampling.sampling import Sampling

ASIDE = 10  # more of Linux's niceness, for threads that prepare what nobody waits for
SKETCH_RATE = 16.0  # pixels of an edge of the sketch's surfaces
# The camera's `nearest` stays while what it goes around is at this many times its distance, so that points stay where they are.
CLOSEST, FARTHEST = 0.5, 16.0


@dataclass(frozen=True)
class View:
    """A picture in progress or finished: samples of its pixels, its error, diagnostics."""

    image: Image
    samples: float  # a pixel, on average
    relmse: tuple[float, float, float] | None  # estimate and 95 % interval
    diagnostics: list[dict[str, str]]
    finished: bool
    drawn: npt.NDArray[np.uint8] | None = None  # (H, W, 4) as displayed, of an AOV that is no light


@dataclass(frozen=True)
class Size:
    """Size of a render: the width of its pixels in those of the whole picture, and samples per pixel."""

    pixel_size: float
    spp: int
    is_draft: bool = False
    keeps_surfaces: bool = False  # as they are diced, wherever the camera is


@dataclass(frozen=True)
class Hit:
    """What a ray hits: the point (3,) in the world, how far away it is, and whose it is."""

    position: Doubles
    distance: float  # scene units
    prim: str  # path, in the instance if it is in one
    instance: str  # name; "": none
    material: str = ""  # path, in the instance likewise; "": none


Answer = Callable[[], bool]
OnProgress = Callable[[str, int, int], None]


class _AbandonedError(Exception):
    """Preparing goes on for a stage that is not looked at any more."""


class ViewedScene:
    """The stage at a path, or a caller's Usd.Stage; used by one thread at a time, except for what it prepares itself.

    Of a caller's stage the layers are shared: its own session layer is not written to. `lock` is held while the stage is
    read, and by whoever edits it meanwhile.

    Raises PrimrayErrors where it cannot be opened or rendered; its state is then that of before. `on_progress` is called from
    any thread, as `Steps.on_progress` is.
    """

    def __init__(
        self,
        source: str | Any,
        settings: RenderSettings,
        on_progress: OnProgress | None = None,
        lock: AbstractContextManager[object] | None = None,
    ) -> None:
        self.source = source
        self.path = source if isinstance(source, str) else usd.stage_name(source)
        self.lock = threading.RLock() if lock is None else lock
        self.settings = settings  # without the camera and variants chosen since
        self.on_progress = on_progress
        self.camera = settings.camera
        self.variants = settings.variants
        self.orbit: Orbit | None = None  # None: the camera is as authored
        self.bounds: Box | None = None  # (3,) low and high corner of the scene
        self.through: Camera | None = None  # camera of the last picture
        self.denoises = False
        self.has_lights = False  # whether pictures have the light of each light apart
        self.aov: str | None = None  # that is shown; None: the picture
        self.selected: Hit | None = None
        self.on_explained: Callable[[], None] = lambda: None  # called from another thread once `explanation` is there
        self.preparing_s = 0.0  # seconds that the last picture took before its first sample
        self.cancellation: compiled.Cancellation | None = None
        self.cameras: list[str] = []
        self.variant_sets: list[dict[str, Any]] = []
        self.times: tuple[float, float] | None = None  # first and last time code; None: nothing varies
        self.time_codes_per_second = 24.0
        self.read_ns = 0  # when its files were read last
        self._authored: Camera | None = None
        self._kept: KeptStage | None = None
        self._z_up = False
        self._nearest = 0.0
        self._front: _Front | None = None  # the scene that is looked at; None: nothing has been prepared
        self._spare: CachedSteps | None = None  # the steps of the one before, to prepare the next one by
        self._next: _Front | None = None  # prepared ahead
        self._preparing: threading.Thread | None = None
        self._is_abandoned = False
        self._prepared: Prepared | None = None
        self._denoising: tuple[Prepared, Denoising] | None = None
        self._explainer = PixelExplainer()
        self._prepared_for: tuple[object, ...] = ()  # what was looked at in the last picture
        self._explained: tuple[object, ...] = ()  # what was looked at when a pixel was explained
        self._edited = 0  # how often the stage was composed or edited

    @property
    def authored_path(self) -> str:
        """Path of the stage's camera that the view started from, wherever it was moved to; "": no camera of the stage."""
        return "" if self._authored is None else self._authored.path

    @property
    def stage(self) -> Any:
        """The Usd.Stage that is rendered; a caller's own."""
        if not isinstance(self.source, str):
            return self.source
        if self._kept is None:
            self.open()
        assert self._kept is not None
        return self._kept.opened.stage

    def open(self, variants: tuple[str, ...] | None = None) -> None:
        """Compose the stage, with other variants if given."""
        chosen = self.variants if variants is None else variants
        self.stop()
        self._edited += 1
        with self.lock:
            self.read_ns = time.time_ns()
            kept = KeptStage(self.source, replace(self.settings, variants=chosen), lock=self.lock, writes_session=True)
            facts = usd.stage_facts(kept.opened.stage)
            self._kept, self.variants = kept, chosen
            self._drop()
            self.selected = None
            self._take(kept.opened.stage, facts)
            self._place()

    def note_edits(self) -> None:
        """Look again at what the stage offers, after it has been edited."""
        self._edited += 1
        if self._kept is not None:
            with self.lock:
                self._take(self._kept.opened.stage, usd.stage_facts(self._kept.opened.stage))

    def _take(self, stage: Any, facts: dict[str, Any]) -> None:
        self.cameras = [path for path in usd.camera_paths(stage) if not usd.is_session_camera(path)]
        self.variant_sets, self._z_up = facts["variants"], facts["up_axis"] == "Z"
        self.times = _times_of(facts["time"])
        self.time_codes_per_second = facts["time"]["time_codes_per_second"]
        if self._authored is not None and self._authored.path and not usd.has_camera(stage, self._authored.path):
            self.camera = self.settings.camera if self.camera == self._authored.path else self.camera
            self.orbit = self._authored = None

    def is_edited(self) -> bool:
        """Return whether the stage has been edited since a picture was last prepared."""
        kept, front = self._kept, self._front
        if kept is None:
            return False
        return kept.is_edited() or (front is not None and front.steps.edits != kept.edits)  # taken to explain a pixel

    def free(self) -> None:
        """Free all that is made of the stage; the stage stays open, and the camera where it is."""
        self.stop()
        self._drop()
        if self._kept is not None:
            with self.lock:
                self._kept.forget()

    def _drop(self) -> None:
        self._front = self._spare = self._next = None
        self._prepared = self._denoising = None

    def read_anew(self, files: Collection[str]) -> None:
        """Reload the stage after these files (absolute paths) have changed."""
        self.stop()
        with self.lock:
            usd.reload_layers(self.path, files)
        self.open()

    def choose(self, prim: str, of_set: str, name: str) -> None:
        """Choose a variant, stronger than all earlier choices."""
        choice = f"{prim}:{of_set}="
        self.open((*(v for v in self.variants if not v.startswith(choice)), choice + name))

    def files(self) -> set[str]:
        """Return absolute paths of the files that the picture may change with."""
        session_layer = self.settings.session_layer
        found = usd.files_to_watch(session_layer) if session_layer else set()
        if isinstance(self.source, str):
            found |= usd.files_to_watch(self.source)
        if self._kept is not None:
            for layer in (
                usd.layer_files(self._kept.opened.stage) - found
            ):  # files that only the session's expression variables lead to
                found |= usd.files_to_watch(layer)
        return found

    def set(self, **values: Any) -> None:
        """Change settings that leave the stage as it is composed."""
        self.settings = replace(self.settings, **values)

    def look_through(self, camera: str | None) -> None:
        """View through a camera of the stage (None: as the settings say), as authored."""
        self.camera = camera if camera is not None else self.settings.camera
        self.orbit = self._authored = None

    def reset(self) -> None:
        """Return to the viewed camera as authored."""
        self.orbit = None

    def move(self, change: Callable[[Orbit, Camera], Orbit]) -> None:
        """Move the camera from where it is; does nothing before the first picture."""
        if self._authored is None or self.through is None:  # it is about to be rendered for the first time
            return
        self.orbit = change(self.orbit or orbit_of(self._authored, self.bounds, self._z_up), self.through)

    def turn_about(self, x: float, y: float) -> None:
        """Go around what is at a point of the picture, in 0 to 1 from its upper left corner; where nothing is, around what is
        framed. The camera stays where it is."""
        if self._authored is None or self.through is None:
            return
        hit, now = self.pick(x, y), self.orbit or orbit_of(self._authored, self.bounds, self._z_up)
        if hit is not None:
            self.orbit = now.about(hit.position)
        else:
            there = replace(self._authored, world_from_camera=now.world_from_camera)
            self.orbit = now.about(orbit_of(there, self.bounds, self._z_up).target)

    def pick(self, x: float, y: float) -> Hit | None:
        """Return what the last picture shows at a point, in 0 to 1 from its upper left corner; None where no surface is."""
        prepared = self._prepared
        if prepared is None or prepared.scene.record is None or self._kept is None:
            return None
        from .. import core

        width, height = prepared.scene.resolution
        at = min(max(int(x * width), 0), width - 1), min(max(int(y * height), 0), height - 1)
        found = core.pick(prepared.scene, *at, prepared.settings)
        if found is None:
            return None
        with self._kept.lock:
            names = usd.names_in_instances(self._kept.opened.stage, [found.prim], [found.material], ())
        prim, material = (names.get(path, path) for path in (found.prim, found.material))
        return Hit(found.position, found.distance, prim, found.instance, material)

    def select(self, x: float, y: float) -> None:
        """Select what is at a point of the picture; where nothing is, nothing."""
        self._explainer.drop()
        self.selected = self.pick(x, y)

    def deselect(self) -> None:
        self._explainer.drop()
        self.selected = None

    def explain(self, x: float, y: float) -> None:
        """Select what is at a point of the picture, and explain the pixel there, in another thread (`explanation`).

        A further selection cancels it. Nothing is explained before the first picture of what is looked at now.
        """
        self.selected = self.pick(x, y)
        prepared, kept = self._prepared, self._kept
        if prepared is None or kept is None or self._prepared_for != self._looked_at:
            self._explainer.drop()
            return
        frame = prepared.frame
        pixels, (width, height) = frame.pixels, frame.resolution
        at = (pixels.x + x * pixels.width) / width, (pixels.y + y * pixels.height) / height
        spp = min(self.settings.most_samples, pixel_explainer.SPP)
        settings = self._settings_of(Size(1.0, spp), self._place())
        self._explained = self._looked_at
        self._explainer.begin(kept, settings, at, lambda: self.on_explained())

    @property
    def explanation(self) -> Explanation | None:
        """That of the pixel that was asked for last, if it is the last selection."""
        return self._explainer.explanation

    @property
    def is_explanation_outdated(self) -> bool:
        """Whether the camera, the stage or its light has changed since."""
        return self._explained != self._looked_at

    def drop_outdated_explanation(self) -> None:
        """Cancel the explanation of a pixel that is not looked at any more; one that is there stays, without its scene."""
        explanation = self.explanation
        if explanation is not None and self.is_explanation_outdated:
            self._explainer.drop()
            if explanation.pixel is not None or explanation.problem is not None:
                self._explainer.explanation = explanation

    @property
    def _looked_at(self) -> tuple[object, ...]:
        return *self._view, self.settings, self.variants, self._edited

    def frame(self) -> None:
        """Show the whole of what is selected, or of everything."""
        box, kept = self.bounds, self._kept
        if self.selected is not None and kept is not None:
            with kept.lock:
                box = usd.world_box(kept.opened.stage, self.selected.prim, self.settings.time_code) or box
        if box is not None:
            self.move(lambda orbit, camera: orbit.framed(box, camera))

    def camera_text(self) -> str:
        """Return the camera as the text of a USD layer to lay over the stage. SettingsError before the first picture."""
        if self._authored is None or self._kept is None:
            raise SettingsError("there is no picture yet, and no camera", code="view-command")
        orbit = self.orbit or orbit_of(self._authored, self.bounds, self._z_up)
        with self._kept.lock:
            self._place_at(orbit, self._authored)
            return usd.camera_layer(self._kept.opened.stage, self.settings.session_layer)

    def _place(self) -> str | None:
        """Write the moved camera to the stage and return its path; None where the camera is as authored."""
        if self.orbit is None or self._authored is None or self._kept is None:
            return None
        with self._kept.lock:
            return self._place_at(self.orbit, self._authored)

    def _place_at(self, orbit: Orbit, authored: Camera) -> str:
        assert self._kept is not None
        if not self._nearest > 0 or not CLOSEST <= orbit.distance / self._nearest <= FARTHEST:
            self._nearest = usd.nearest_of(orbit.distance)
        return usd.place_camera(self._kept.opened.stage, orbit.world_from_camera, authored, orbit.zoom, self._nearest)

    @property
    def is_sketch(self) -> bool:
        """Whether all that can be rendered now is a sketch."""
        return self._next is None and self._front is not None and self._front.is_sketch

    @property
    def is_exact(self) -> bool:
        """Whether a picture that is rendered now is that of `primray.render`, without anything prepared ahead."""
        front = self._next or self._front
        if front is None or front.is_sketch or front.made_for is None or self.through is None:
            return front is not None and not front.is_sketch
        is_near = np.array_equal(rebasing_origin(front.made_for), rebasing_origin(self.through))
        return front.view == self._view or (is_near and not front.has_cages)

    @property
    def _view(self) -> tuple[object, ...]:
        """What decides where the camera is; orbits are equal if they are the same."""
        return self.orbit, self.camera, self.settings.time_code

    def prepare_ahead(self, ended: Callable[[], None]) -> None:
        """Prepare the scene as it is seen from here in a thread, unless one does so already; `ended` is called from there."""
        if self._preparing is not None and self._preparing.is_alive():
            return
        kept, settings = self._kept, self._settings_of(Size(1.0, self.settings.most_samples), self._place())
        assert kept is not None
        steps, view, orbit = self._spare or self._new_steps(kept), self._view, self.orbit
        self._spare, self._is_abandoned = None, False

        is_awaited = self.is_sketch

        def prepare() -> None:
            nonlocal view
            if not is_awaited:  # whoever moves the camera meanwhile comes first
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), os.getpriority(os.PRIO_PROCESS, 0) + ASIDE)
            try:
                prepared = kept.prepare(settings, Costs(), Diagnostics(), steps=steps)
            except _AbandonedError:
                return
            except Exception:  # whatever it is: the next picture is prepared again, and reports it
                self._next = _Front(steps)
            else:
                camera = prepared.camera
                if orbit is not None and not np.allclose(camera.world_from_camera, orbit.world_from_camera, 0, 1e-9):
                    view = ()  # it has been moved by then
                self._next = _Front(steps, camera, view, _has_cages(kept, settings))
            ended()

        self._preparing = threading.Thread(target=prepare, name="preparing", daemon=True)
        self._preparing.start()

    def stop_preparing(self) -> None:
        """End what is prepared ahead, and return when no thread reads the stage any more."""
        self._is_abandoned = True
        if self._preparing is not None and self._preparing is not threading.current_thread():
            self._preparing.join()
        self._preparing = None

    def stop(self) -> None:
        """End all threads, and return when none reads the stage any more."""
        self._explainer.stop()
        self.stop_preparing()

    def _tell(self, step: str, done: int, of: int) -> None:
        if self._is_abandoned and threading.current_thread() is self._preparing:
            raise _AbandonedError
        if self.on_progress is not None:
            self.on_progress(step, done, of)

    def render(self, size: Size, show: Callable[[View], None], is_due: Answer, continues: Answer) -> bool:
        """Render until all samples are taken, and return True, or False once `continues` answers False.

        `show` gets the picture whenever one `is_due`, and the last one.
        """
        from ..core.scene import Cancelled
        from ..sampling.sampling import Sampling

        start = time.perf_counter()
        prepared, diagnostics, costs = self._prepare(size)
        self.preparing_s = time.perf_counter() - start
        if self.aov is not None:
            show(self._aov_view(prepared, diagnostics))
            return True
        prepared.scene.cancellation = self.cancellation
        try:
            sampling = Sampling.begin(prepared.scene, prepared.settings)
            # Something to see soon; the error of a draft is that of its first look.
            sampling.schedule = replace(sampling.schedule, first_look=True, pilot=size.is_draft)
            while not sampling.run(lambda *_: continues(), lambda: sampling.done > 0 and is_due()):
                show(_view(self._so_far(prepared, sampling), sampling, diagnostics, False))
        except Cancelled:
            return False
        if sampling.stop is not None and sampling.stop.reason == "interrupted":
            return False
        show(_view(self._finished(size, prepared, sampling, costs, diagnostics), sampling, diagnostics, True))
        return True

    def _so_far(self, prepared: Prepared, sampling: Sampling) -> Image:
        image = replace(picture_so_far(prepared, sampling), aovs=lights_so_far(prepared, sampling))
        if not self.denoises or sampling.film.samples_per_pixel[0] == 0:
            return image
        from ..denoising.denoised import Denoising, guides_of, with_denoised

        if self._denoising is None or self._denoising[0] is not prepared:
            guides = guides_of(prepared.scene, prepared.settings)
            self._denoising = prepared, Denoising(guides, prepared.scene.exposure_scale, prepared.settings)
        return with_denoised(image, self._denoising[1].of(sampling.film))

    def _finished(self, size: Size, prepared: Prepared, sampling: Sampling, costs: Costs, diagnostics: Diagnostics) -> Image:
        settings = prepared.settings
        if size.is_draft and settings.background is None and prepared.ground_shadow is None:
            return self._so_far(prepared, sampling)  # a draft: nobody reads its report
        if self.denoises:
            prepared = replace(prepared, settings=replace(settings, denoise=True))
        return picture_of(prepared, sampling, costs, diagnostics)

    def _aov_view(self, prepared: Prepared, diagnostics: Diagnostics) -> View:
        from ..aovs import requests_of
        from ..images.first_hit import aovs_of
        from .aov_pictures import drawn

        assert self.aov is not None
        scene, width, height = prepared.scene, *prepared.scene.resolution
        requests, counts = requests_of([self.aov]), np.zeros((2, height, width), np.uint32)
        found = aovs_of(scene, requests, prepared.camera, counts, prepared.settings)
        image, picture = drawn(found[requests[0].name], prepared)
        return View(replace(image, aovs=found), 1.0, None, [d.as_json() for d in diagnostics], True, picture)

    def _settings_of(self, size: Size, moved: str | None) -> RenderSettings:
        return replace(
            self.settings,
            camera=moved or self.camera,
            variants=self.variants,
            pixel_size=size.pixel_size,
            spp=size.spp,
            aovs=(LIGHTS,) if self.has_lights and self.aov is None else (),
        )

    def _prepare(self, size: Size) -> tuple[Prepared, Diagnostics, Costs]:
        if self._kept is None:
            self.open()
        assert self._kept is not None
        kept, moved = self._kept, self._place()
        settings = self._settings_of(size, moved)
        front = self._front_for(kept, size, settings)
        if front.is_sketch:
            settings = _sketched(settings)
        if front.made_for is not None and size.keeps_surfaces:
            settings = replace(settings, dicing_camera=front.made_for)
        costs, diagnostics = Costs(), Diagnostics()
        prepared = kept.prepare(settings, costs, diagnostics, steps=front.steps)
        if settings.dicing_camera is None:
            has_cages = _has_cages(kept, settings)
            self._front = replace(front, made_for=prepared.camera, view=self._view, has_cages=has_cages)
        self.through, self.bounds, self._prepared = prepared.camera, prepared.scene.bounds, prepared
        if moved is None:
            self._authored = prepared.camera
        self._prepared_for = self._looked_at
        return prepared, diagnostics, costs

    def _front_for(self, kept: KeptStage, size: Size, settings: RenderSettings) -> _Front:
        """Return the scene that a picture is rendered of: what has been prepared ahead, else what there is, else a new one."""
        found, self._next = self._next, None
        if found is not None:
            before, self._front = self._front, found
            self._spare = None if before is None or before.is_sketch else before.steps
        if self._front is not None and self._front.is_sketch and not size.is_draft:
            self.stop_preparing()
            self._front = None
        if self._front is None:
            self._tell("translate", 0, 0)
            is_sketch = size.is_draft and _is_heavy(kept.translated(settings))
            self._front = _Front(self._new_steps(kept), is_sketch=is_sketch)
        return self._front

    def _new_steps(self, kept: KeptStage) -> CachedSteps:
        steps = kept.further_steps()
        steps.has_record, steps.on_progress = True, self._tell
        return steps


@dataclass(frozen=True)
class _Front:
    """A scene that is looked at, by the steps that prepare it. `made_for`: the camera that its surfaces are diced for, and near
    which lengths are measured; None: it is not made yet."""

    steps: CachedSteps
    made_for: Camera | None = None
    view: tuple[object, ...] = ()  # of that camera
    has_cages: bool = False
    is_sketch: bool = False


def _has_cages(kept: KeptStage, settings: RenderSettings) -> bool:
    """Return whether surfaces are diced."""
    return any(isinstance(shape, SubdivisionMesh | NurbsPatch | Ribbons) for shape in kept.translated(settings).shapes)


def _sketched(settings: RenderSettings) -> RenderSettings:
    return replace(settings, surface_textures=False, dicing_rate=max(settings.dicing_rate, SKETCH_RATE))


def _is_heavy(description: SceneDescription) -> bool:
    """Return whether a scene has what a sketch leaves out."""
    curved = any(isinstance(shape, SubdivisionMesh | NurbsPatch | Ribbons) for shape in description.shapes)
    return curved or any(without_images(surface) is not surface for surface in description.surfaces)


def _times_of(facts: dict[str, Any]) -> tuple[float, float] | None:
    """Return the range of a frame slider: the authored one, else that of the values; None where nothing varies."""
    if not facts["sampled"] or facts["sampled"][0] == facts["sampled"][1]:
        return None
    first, last = facts["sampled"] if facts["start"] is None or facts["end"] is None else (facts["start"], facts["end"])
    return (first, last) if math.isfinite(last - first) and last > first else tuple(facts["sampled"])


def _view(image: Image, sampling: Sampling, diagnostics: Diagnostics, finished: bool) -> View:
    last = sampling.curve.last
    relmse = None if last is None else (last.error.relmse.value, last.error.relmse.low, last.error.relmse.high)
    return View(image, sampling.mean_samples(), relmse, [d.as_json() for d in diagnostics], finished)
