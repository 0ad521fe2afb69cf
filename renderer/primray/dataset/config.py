"""The config of a data set: a YAML file, or Python's own dict, that says what is rendered, what varies, and what is written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..errors import SettingsError
from ..settings import RenderSettings
from .document import Entry, document_of_text, document_of_values, read_text
from .variations import FILE_SETTINGS, Variation, check_setting, setting_name, variation_of

MOST_SAMPLES = 10_000_000
PICTURES = ("png", "exr", "npy")
OF_LIGHT = ("png", "exr")
# Settings that a data set has in other places, or that would make its pictures depend on a clock or on other samples.
REFUSED_SETTINGS = {
    "seed": "the seed of a data set is a key of its own",
    "threads": "threads are a flag of the command",
    "label_table": "the table of labels is labels: table",
    "time_limit_s": "a time limit would make pictures depend on the clock",
    "sample_range": "a sample is a whole picture",
    "region": "a sample is a whole picture",
    "eye": "a sample is one picture; vary the camera",
    "render_pass": "passes change the stage",
    "product": "products name files of their own",
    "joint_products": "products name files of their own",
}
COMPOSING = ("variants", "load", "mask", "session_layer")


@dataclass(frozen=True)
class Labels:
    """Labelled things: the taxonomy of their labels, and the ids of classes by a table's file or in the order of a list."""

    taxonomy: str
    table: str | None = None
    classes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Config:
    """What a data set is made of. `plain`: the document as JSON has it; `folder`: where its relative files are.

    >>> config = primray.dataset.Config.of({"stage": "shot.usda", "samples": 2, "settings": {"spp": 2}})
    >>> config.samples, config.seed
    (2, 0)
    """

    plain: Mapping[str, Any]
    folder: Path
    stage: Path
    samples: int
    seed: int
    settings: Mapping[str, Any]
    labels: Labels | None
    varied: Mapping[str, Variation]
    entries: Mapping[str, Entry]  # of what varies, by name
    pictures: tuple[str, ...]
    writers: Mapping[str, Any]  # options by writer
    light: bool = True  # else samples are AOVs and labels of what the camera sees first, without a picture
    files: Mapping[str, str] = field(default_factory=dict)  # path of each named file, by its name in the config
    text: str = ""  # of the YAML, "" where there is none
    name: str = "config"  # in messages

    @staticmethod
    def of(values: Mapping[str, Any], folder: str | os.PathLike[str] = ".") -> Config:
        """Return the config of plain values; SettingsError, dataset-config, with the key of what is wrong."""
        return _config_of(document_of_values(values), Path(folder))

    @staticmethod
    def read(path: str | os.PathLike[str]) -> Config:
        """Return the config of a YAML file; SettingsError, dataset-config, with the line and key of what is wrong."""
        file = Path(path)
        return Config.parse(read_text(file), file.absolute().parent, file.name)

    @staticmethod
    def parse(text: str, folder: str | os.PathLike[str] = ".", name: str = "config") -> Config:
        """Return the config of a YAML text."""
        return replace(_config_of(document_of_text(text, name), Path(folder)), text=text, name=name)

    @property
    def resolution(self) -> tuple[int, int]:
        width, height = self.settings["resolution"]
        return int(width), int(height)

    @property
    def composition(self) -> dict[str, Any]:
        """Settings of how the stage is opened."""
        return {name: value for name, value in self.settings.items() if name in COMPOSING}


def _config_of(root: Entry, folder: Path) -> Config:
    from .writers import WRITERS

    folder = folder.absolute()
    fields = root.fields(("stage", "samples"), ("seed", "settings", "labels", "vary", "pictures", "light", "write"))
    stage = folder / fields["stage"].text()
    if not stage.exists():
        raise fields["stage"].fault(f"there is no file {stage}")
    labels = _labels_of(fields["labels"], folder) if "labels" in fields else None
    varied = fields["vary"].items() if "vary" in fields else {}
    variations = {name: variation_of(entry, folder) for name, entry in varied.items()}
    settings = _settings_of(fields.get("settings"), folder)
    named = [*_named(fields), *([labels.table] if labels and labels.table else [])]
    named += [name for each in variations.values() for name in each.files()]
    light = fields["light"].flag() if "light" in fields else True
    pictures: tuple[str, ...] = ("png",) if light else ()
    if "pictures" in fields:
        pictures = tuple(e.one_of(PICTURES) for e in fields["pictures"].entries())
    if not light:
        _check_without_light(fields, pictures, settings, labels)
    write = _writers_of(fields["write"], WRITERS) if "write" in fields else {}
    for name in write:
        if WRITERS[name].NEEDS_LABELS and labels is None:
            raise fields["write"].fault(f"{name} needs labels: write labels: {{taxonomy: class}}, or leave it out")
        if WRITERS[name].NEEDS_PINHOLE and settings.get("panorama") is not None:
            raise fields["write"].fault(f"{name} needs cameras with an intrinsic matrix, which a panorama has not")
        for needed in WRITERS[name].PICTURES:
            if needed not in pictures:
                raise fields["write"].fault(f"{name} needs {needed} among the pictures")
        for needed in WRITERS[name].AOVS:
            if needed not in settings.get("aovs", ()):
                raise fields["write"].fault(f"{name} needs the AOV {needed}: settings: {{aovs: [{needed}]}}")
    return Config(
        plain=root.plain,
        folder=folder,
        stage=stage,
        samples=fields["samples"].whole(1, MOST_SAMPLES),
        seed=fields["seed"].whole() if "seed" in fields else 0,
        settings=settings,
        labels=labels,
        varied=variations,
        entries=dict(varied),
        pictures=pictures,
        writers=write,
        light=light,
        files={name: path for name in sorted(set(named)) if os.path.isfile(path := _path(name, folder))},
    )


def _check_without_light(
    fields: Mapping[str, Entry], pictures: tuple[str, ...], settings: Mapping[str, Any], labels: Labels | None
) -> None:
    """Refuse what is made of light, and a data set of nothing."""
    from ..aovs import needs_light

    if made := [name for name in pictures if name in OF_LIGHT]:
        raise fields["pictures"].fault(f"{made[0]} is a picture: without light there are only AOVs, as npy")
    if made := [name for name in settings.get("aovs", ()) if needs_light(name)]:
        raise fields["settings"].items()["aovs"].fault(f"{made[0]} is made of light")
    if labels is None and "npy" not in pictures:
        raise fields["light"].fault("without light, labels or pictures: [npy] must say what a sample has")


def _named(fields: Mapping[str, Entry]) -> list[str]:
    """Return the files that settings name."""
    settings = fields["settings"].items() if "settings" in fields else {}
    return [settings[name].text() for name in FILE_SETTINGS if name in settings]


def _path(name: str, folder: Path) -> str:
    return name if "://" in name else os.path.abspath(folder / name)


def _settings_of(entry: Entry | None, folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, each in (entry.items() if entry is not None else {}).items():
        setting_name(Entry(name, each.key, each.file, each.line))
        if name in REFUSED_SETTINGS:
            raise each.fault(REFUSED_SETTINGS[name])
        value = _path(each.text(), folder) if name in FILE_SETTINGS else each.plain
        check_setting(each, name, value)
        found[name] = value
    try:
        RenderSettings(**found)
    except SettingsError as error:
        assert entry is not None
        raise entry.fault(f"{error.message} [{error.where}]") from None
    if "resolution" not in found:
        found["resolution"] = [640, 480]
    return found


def _labels_of(entry: Entry, folder: Path) -> Labels:
    fields = entry.fields((), ("taxonomy", "table", "classes"))
    if "table" in fields and "classes" in fields:
        raise fields["classes"].fault("ids of classes are of a table or of a list, not both")
    classes = tuple(fields["classes"].texts()) if "classes" in fields else ()
    if len(set(classes)) < len(classes):
        raise fields["classes"].fault("a class is there twice")
    if "table" in fields and not (folder / fields["table"].text()).is_file():
        raise fields["table"].fault(f"there is no file {folder / fields['table'].text()}")
    taxonomy = fields["taxonomy"].text() if "taxonomy" in fields else "class"
    if not taxonomy:
        raise fields["taxonomy"].fault("a taxonomy has a name, as in semantics:labels:class")
    return Labels(
        taxonomy=taxonomy,
        table=fields["table"].text() if "table" in fields else None,
        classes=classes,
    )


def _writers_of(entry: Entry, writers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of each writer, from a list of names, or from options by name."""
    if not isinstance(entry.value, dict):
        return {each.one_of(tuple(writers)): writers[each.text()].options(None) for each in entry.entries()}
    found = {}
    for name, each in entry.value.items():
        Entry(name, each.key, each.file, each.line).one_of(tuple(writers))
        found[name] = writers[name].options(None if each.value is None else each)
    return found
