"""`pin`: renders a picture, and writes the lock with which anyone can verify its bits."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np

from ..aovs import has_deep
from ..content_hash import hash_of_array
from ..diagnostic_messages import Announcer
from ..diagnostics import Diagnostics
from ..errors import RenderCancelled, SettingsError
from ..read_files import watching_files
from ..render.interruption import interruption
from ..render.prepare import Steps, open_once, prepare
from ..render.progress import shown_progress
from ..render.render import picture_of, with_setting_names
from ..report.report import Costs
from ..sampling.sampling import Sampling
from ..settings import Ground, RenderSettings, with_values
from .inputs import environment, files_of, hashes, settings_for_lock, versions, with_real_folder
from .lock import SHORT, SUFFIX, Lock, Pass, Picture, counts_of, hashes_of_tiles
from .things import things_of

if TYPE_CHECKING:
    import numpy.typing as npt

    from ..core import Film
    from ..description import SceneDescription
    from ..images.image import Image
    from ..render.prepare import Textures
    from ..report.prepared import Prepared
    from ..sampling.sampling import Progress
    from ..settings.written import SettingsValues


@dataclass(frozen=True)
class Pinned:
    """A pinned picture, its lock, and the lock's file.

    >>> pinned = primray.pin("shot.usda", lock="shot.lock.json", resolution=(32, 18), spp=2)
    >>> pinned.image.resolution, sorted(pinned.lock.inputs)
    ((32, 18), ['shot.usda'])
    """

    image: Image
    lock: Lock
    file: Path


@with_setting_names
def pin(
    stage: str | os.PathLike[str],
    picture: str | os.PathLike[str] | None = None,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    lock: str | os.PathLike[str] | None = None,
    progress: Progress | Literal[False] | None = None,
    **values: Unpack[SettingsValues],
) -> Pinned:
    """Render a stage, save the picture as an EXR, and write a lock: hashes of all that its bits depend on, and of the bits.

    >>> pinned = primray.pin("shot.usda", "pinned.exr", resolution=(32, 18), spp=2)
    >>> pinned.file.name
    'pinned.lock.json'
    >>> primray.verify("pinned.lock.json").difference is None
    True

    `picture`: None saves none. `lock`: None is beside the picture, else beside the stage. Fields of RenderSettings may be
    passed by name. SettingsError for pictures that no tile alone has the bits of: with a background, a ground's shadow or deep
    samples.
    """
    settings = with_values(settings, values)
    if not isinstance(stage, str | os.PathLike):
        raise SettingsError("pinning needs the stage's path, whose files are hashed", where="stage", code="pin-setting")
    root = with_real_folder(Path(stage))
    with watching_files():  # neither output may replace what the picture is made of
        place = _place(root, picture, lock)
        check(settings)
        with shown_progress(progress) as shown:
            found, image = _rendered(root, settings, shown, Announcer(stage))
    if picture is not None:
        found = replace(found, file=_saved(image, Path(picture), place, found.picture.pixels_sha256))
    found = replace(found, stage=Path(os.path.relpath(root, with_real_folder(place).parent)).as_posix())
    from ..images.image import write_text

    write_text(place, found.text)
    return Pinned(image, found, place)


def _place(stage: Path, picture: str | os.PathLike[str] | None, lock: str | os.PathLike[str] | None) -> Path:
    from ..images.image import check_output_path
    from ..images.output_path import check_folder

    if picture is not None and check_output_path(picture).suffix.lower() != ".exr":
        raise SettingsError(
            "the picture that is pinned is an EXR, which has all of its bits", where=str(picture), code="pin-output"
        )
    beside = stage if picture is None else Path(picture)
    place = beside.with_name(f"{beside.stem}{SUFFIX}") if lock is None else Path(lock)
    check_folder(place)
    if picture is not None and os.path.realpath(place) == os.path.realpath(picture):
        raise SettingsError("the lock and the picture are the same file", where=str(place), code="pin-output")
    return place


def check(settings: RenderSettings) -> None:
    """Raise SettingsError for settings whose pictures cannot be pinned."""
    faults = {
        "sample_range": (settings.sample_range is not None, "a range of samples is no picture: pin the merged one"),
        "background": (settings.background is not None, "a background is composited after the render: pin without it"),
        "ground": (settings.ground is Ground.SHADOW, "a ground's shadow is a render of its own: pin without it"),
        "label_table": (settings.label_table is not None, "renders extend the table of labels: pin without it"),
    }
    for name, (is_refused, why) in faults.items():
        if is_refused:
            raise SettingsError(why, where=name, code="pin-setting")


class WatchedSteps(Steps):
    """Steps of preparation that digest what reaches the core, by prim, and record which image files were read."""

    def __init__(self) -> None:
        self.things: dict[str, str] = {}
        self.read: set[str] = set()

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        self.things = things_of(description, textures)
        self.read = {file.path for file, images in textures.items() if images and os.path.isfile(file.path)}
        return super().fingerprint(description, textures)


def prepared_for(
    stage: Path, settings: RenderSettings, costs: Costs, diagnostics: Diagnostics
) -> tuple[Prepared, WatchedSteps]:
    """Return a stage that is ready to sample, with digests of all that reaches the core."""
    steps, opened = WatchedSteps(), open_once(stage, settings)
    prepared = prepare(opened.stage, opened.diagnostics, settings, costs, diagnostics, fingerprinted=True, steps=steps)
    if has_deep(prepared.aovs):
        raise SettingsError("deep pictures cannot be pinned: leave out --aov deep", where="aovs", code="pin-setting")
    return prepared, steps


def _rendered(root: Path, settings: RenderSettings, progress: Progress | None, announcer: Announcer) -> tuple[Lock, Image]:
    """Return the picture and its lock, without the stage's and the picture's file."""
    costs, diagnostics, passes = Costs(), Diagnostics(), list[Pass]()
    files = files_of(root, settings)
    before = hashes(files, root.parent)
    prepared, steps = prepared_for(root, settings, costs, diagnostics)
    announcer.tell(diagnostics)
    before |= hashes(sorted(steps.read - set(files)), root.parent)
    with costs.stage("render"), interruption() as asked:
        sampling = _sampled(
            prepared, passes, lambda *said: not asked.asked and (progress is None or progress(*said) is not False)
        )
    assert sampling.stop is not None
    if sampling.stop.reason == "interrupted":
        if asked.asked:
            raise KeyboardInterrupt
        raise RenderCancelled("the render was stopped by its progress callback")
    image = picture_of(prepared, sampling, costs, diagnostics)
    announcer.tell(diagnostics)
    if (now := hashes(files, root.parent)) != {name: before[name] for name in now}:
        changed = next(name for name, digest in now.items() if before.get(name) != digest)
        raise SettingsError("the file changed while it was rendered: pin again", where=changed, code="pin-input")
    pixels = sampling.film.image()[0]
    window = prepared.frame.pixels
    picture = Picture(
        resolution=(window.width, window.height),
        origin=(window.x, window.y),
        samples=int(sampling.film.samples),
        splits=(sampling.splits.paths, sampling.splits.lights),
        pixels_sha256=image.report["pixels_sha256"],
        counts=counts_of(sampling.film.next),
        tiles=hashes_of_tiles(pixels),
        passes=passes,
    )
    lock = Lock(
        stage="",
        file=None,
        inputs=before,
        settings=settings_for_lock(prepared.settings, root.parent),
        isa=image.report["isa"],
        versions=versions(),
        environment=environment(),
        scene={f"all {name}": digest for name, digest in prepared.fingerprint.items()} | steps.things,
        picture=picture,
        aovs=hashes_of_aovs(image.aovs),
        error=image.report["error"],
    )
    return lock, image


def _sampled(prepared: Prepared, passes: list[Pass], progress: Progress) -> Sampling:
    """Sample until a stopping rule applies, and note the hashes of the samples of each pass alone, by tile."""
    from ..denoising.denoised import denoised_target

    sampling = Sampling.begin(prepared.scene, prepared.settings)
    sampling.judge_by, sampling.mixes = denoised_target(prepared.scene, prepared.settings), prepared.mixes

    def note(of_pass: Film) -> None:
        tiles = "".join(digest[:SHORT] for digest in hashes_of_tiles(of_pass.image()[0]))
        passes.append(Pass(sampling.mean_samples(), counts_of(sampling.film.next), tiles))

    sampling.on_film_of_pass = note
    sampling.run(progress)
    return sampling


def hashes_of_aovs(aovs: Mapping[str, Any]) -> dict[str, str]:
    """Return the hash of each AOV's values, as a file has them: real numbers in 32 bits."""
    return {name: hash_of_array(_as_stored(aov.values)) for name, aov in sorted(aovs.items())}


def _as_stored(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return values.astype(np.float32) if values.dtype.kind == "f" else values


def _saved(image: Image, path: Path, lock: Path, sha256: str) -> str:
    """Save the picture, all of it as floats, and return its path relative to the lock's folder."""
    from ..images.image import pixels_sha256
    from ..images.reading import read_image

    image.save(path, half=("none",))
    if pixels_sha256(read_image(path).pixels) != sha256:
        sentence = "the EXR does not hold the picture's bits, as the stage's product orders other channels"
        raise SettingsError(sentence, where=str(path), code="pin-output")
    return Path(os.path.relpath(with_real_folder(path), with_real_folder(lock).parent)).as_posix()
