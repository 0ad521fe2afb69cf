"""Renders samples of a data set on a scene that stays ready: what one worker does.

A sample is what its index makes of the stage. The picture is that of a new render of the stage with its edits, to the bit.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..camera import Projection, camera_as_json
from ..content_hash import hash_of_array
from ..errors import PrimrayError, SettingsError
from ..incremental.scene import KeptStage
from ..settings import RenderSettings, with_values
from .draws import Draws
from .ledger import RECORD, new_sample
from .variations import Phase, SampleState

if TYPE_CHECKING:
    from ..diagnostics import Diagnostics
    from ..images.image import Image
    from ..labels.shapes import ThingShape
    from ..render.first_hits import FirstHits
    from .config import Config

THINGS = "object_instance"  # AOV of labelled things
INDEX_MAP = "things.png"
MOST_THINGS = 2**16 - 1
SEED_BITS = 31


class Sampler:
    """Renders samples of one config. `classes`: the table of class ids, or None where nothing is labelled.

    >>> config = primray.dataset.Config.of({"stage": "shot.usda", "samples": 2, "settings": {"resolution": [32, 18], "spp": 2}})
    >>> image, record = primray.dataset.Sampler(config).render(1)
    >>> image.resolution, record["index"]
    ((32, 18), 1)
    """

    def __init__(self, config: Config, *, threads: int | None = None, scratch: Path | None = None, classes: str = "") -> None:
        from ..usd import VariedStage

        self._config, self._threads = config, threads
        self._table, self._classes = None if scratch is None else scratch / "labels.json", classes
        self._kept = KeptStage(config.stage, RenderSettings(**config.composition))
        self._time_code = config.settings.get("time_code")
        self._varied = VariedStage(self._kept.opened.stage, config.folder, self._time_code)
        self._is_ready = False

    def close(self) -> None:
        self._kept.forget()

    def check(self) -> None:
        """Find what varies on the stage; SettingsError, with the place in the config, for what is not there."""
        if self._is_ready:
            return
        for name, variation in sorted(self._config.varied.items(), key=lambda item: item[1].phase):
            with self._placed_in_config(name):
                variation.bind(self._varied)
        self._is_ready = True

    @contextmanager
    def _placed_in_config(self, name: str) -> Iterator[None]:
        entry = self._config.entries[name]
        try:
            yield
        except SettingsError as error:
            if not error.where.startswith(entry.file):
                error.where = f"{entry.where}: {error.where}" if error.where else entry.where
            raise

    def apply(self, index: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """Edit the stage as a sample has it; return what was drawn by name, and the settings that go with it."""
        self.check()
        drawn: dict[str, Any] = {}
        state = SampleState(self._varied, index, self._config.resolution)
        for phase in Phase:
            for name, variation in self._config.varied.items():
                if variation.phase is phase:
                    with self._placed_in_config(name):
                        drawn[name] = variation.apply(Draws(self._config.seed, index, name), state)
            self._write(phase, state)
        return {name: drawn[name] for name in self._config.varied}, state.settings

    def _write(self, phase: Phase, state: SampleState) -> None:
        if phase is Phase.VARIANTS and state.choices:
            self._varied.choose(state.choices)
        elif phase is Phase.VALUES:
            self._varied.set_values(state.values)
        elif phase is Phase.POSES:
            self._varied.place_local(state.places)

    def render(self, index: int) -> tuple[Image | FirstHits, dict[str, Any]]:
        """Return the picture of a sample, or without light what its camera sees first, and its record."""
        drawn, settings = self.apply(index)
        settings = {**self._config.settings, **settings}
        settings["aovs"] = self._aovs(settings)
        settings["seed"] = Draws(self._config.seed, index, "").bits() >> (64 - SEED_BITS)
        if self._config.labels is not None and self._table is not None:
            self._reset_table()
            settings["label_table"] = str(self._table)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # diagnostics are in the record
            image = self._rendered(with_values(RenderSettings(threads=self._threads), settings))
        self._check_classes()
        return image, self._record(index, image, drawn)

    def _rendered(self, settings: RenderSettings) -> Image | FirstHits:
        if not self._config.light:
            return self._kept.first_hits(settings, _untold)
        # The record has no error of the picture, which costs a tenth of a small one.
        return self._kept.render(settings, None, "raise", None, (), _untold, measures_error=False)

    def shapes(self, index: int, paths: Collection[str]) -> dict[str, ThingShape]:
        """Return the shapes of labelled things as a sample has them, by path; those without a surface are left out."""
        from ..diagnostics import Diagnostics
        from ..labels.shapes import shapes_of
        from ..report.report import Costs

        assert self._config.labels is not None
        _, settings = self.apply(index)
        settings = {**self._config.settings, **settings, "aovs": self._aovs({})}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # diagnostics are in the record
            wanted = with_values(RenderSettings(threads=self._threads), settings)
            prepared = self._kept.prepare(wanted, Costs(), Diagnostics())
        return shapes_of(prepared, self._config.labels.taxonomy, paths)

    def _aovs(self, settings: dict[str, Any]) -> list[str]:
        asked = list(settings.get("aovs", ()))
        labels = self._config.labels
        return asked if labels is None else list(dict.fromkeys([*asked, f"{THINGS}:{labels.taxonomy}"]))

    def _reset_table(self) -> None:
        """Have each render begin with the same table, so that no id depends on what was rendered before."""
        assert self._table is not None
        if not self._table.exists() or self._table.read_text(encoding="utf-8") != self._classes:
            self._table.unlink(missing_ok=True)
            if self._classes:
                self._table.write_text(self._classes, encoding="utf-8")

    def _check_classes(self) -> None:
        if self._config.labels is None or self._table is None or not self._classes:
            return
        known, found = (json.loads(text)["classes"] for text in (self._classes, self._table.read_text(encoding="utf-8")))
        taxonomy = self._config.labels.taxonomy
        if new := ", ".join(sorted(found.get(taxonomy, {}).keys() - known.get(taxonomy, {}).keys())):
            labels = self._config.labels
            if labels.table is not None:
                message = f"the label table {labels.table} has no ids of classes of the stage: {new}; add them to it"
            elif labels.classes:
                message = f"labels: classes lacks classes of the stage: {new}; add them to the list"
            else:
                message = f"the stage gets classes that the first sample does not have: {new}; list all in labels: classes"
            raise SettingsError(
                message,
                where=self._config.labels.taxonomy,
                code="dataset-classes",
            )

    def _record(self, index: int, image: Image | FirstHits, drawn: dict[str, Any]) -> dict[str, Any]:
        report, camera = image.report, image.camera
        assert camera is not None
        pinhole = camera.projection is Projection.PERSPECTIVE and not camera.is_panorama
        told = {(row["severity"], row["code"], row["prim_path"]) for row in report["diagnostics"] if row["severity"] != "info"}
        return {
            "index": index,
            "varied": drawn,
            "resolution": list(image.resolution),
            "meters_per_unit": self._varied.meters_per_unit,
            "camera": camera_as_json(camera)
            | {
                "intrinsics": camera.intrinsics(image.resolution).tolist() if pinhole else None,
                "opencv_camera_from_world": camera.opencv_camera_from_world.tolist(),
            },
            "things": report.get("labels", {}).get("things", []),
            "pixels_sha256": report.get("pixels_sha256"),  # None: there is no picture
            "aovs_sha256": {name: hash_of_array(aov.values) for name, aov in sorted(image.aovs.items())},
            "diagnostics": [dict(zip(("severity", "code", "prim_path"), row, strict=True)) for row in sorted(told)],
        }

    def make(self, index: int, folder: Path) -> dict[str, Any]:
        """Render a sample and put it into place in a data set's folder; return its record."""
        image, record = self.render(index)
        with new_sample(folder, index) as place:
            record["files"] = write_pictures(image, record, self._config, place)
            (place / RECORD).write_text(record_text(record), encoding="utf-8")
        return record


def _untold(diagnostics: Diagnostics) -> None:
    """Let go of a render's diagnostics: the record has them."""


def record_text(record: dict[str, Any]) -> str:
    return json.dumps(record, ensure_ascii=False) + "\n"


def write_pictures(image: Image | FirstHits, record: dict[str, Any], config: Config, place: Path) -> dict[str, str]:
    """Write a sample's pictures; return the names of its files by what they hold."""
    from ..images.encoding import Encoding
    from ..images.image import Image, write_png

    files = {}
    if isinstance(image, Image):
        view = image.view_of()
        for kind, what in (("png", "picture"), ("exr", "exr")):
            if kind in config.pictures:
                path = place / f"picture.{kind}"
                files[what] = image.write(path, view, image.file.view.exposure, Encoding(is_quick=True)).name
    if "npy" in config.pictures:
        for name, aov in image.aovs.items():
            file = f"{file_name(name)}.npy"
            np.save(place / file, np.ascontiguousarray(aov.values))
            files[name] = file
    if config.labels is not None:
        ids = image.aovs[f"{THINGS}:{config.labels.taxonomy}"].values[..., 0]
        write_png(index_map(ids, record["things"])[..., None], place / INDEX_MAP, is_quick=True)
        files["things"] = INDEX_MAP
    return files


def file_name(aov: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in aov)


def index_map(ids: np.ndarray[Any, Any], things: list[dict[str, Any]]) -> np.ndarray[Any, Any]:
    """Return (H, W), 16 bits: 0 where nothing is labelled, else the place of the thing in the record's list, from 1."""
    numbers = [thing["id"] for thing in things]
    if len(numbers) > MOST_THINGS:
        raise PrimrayError(f"{len(numbers)} things are more than the {MOST_THINGS} of one picture", code="dataset-things")
    order = np.argsort(np.array(numbers, np.int64))
    ranked = np.array(numbers, np.int64)[order]
    flat = ids.astype(np.int64).ravel()
    if not len(ranked):
        return np.zeros(ids.shape, np.uint16)
    at = np.minimum(np.searchsorted(ranked, flat), len(ranked) - 1)
    found = np.where(ranked[at] == flat, order[at] + 1, 0)
    return found.astype(np.uint16).reshape(ids.shape)


def isa_class() -> str:
    """Return the class of CPUs that the core in use is compiled for."""
    from .. import core

    return str(core.isa())
