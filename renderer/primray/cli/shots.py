"""What one command renders, picture by picture: frames of the stage, or of several of its products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SettingsError
from ..render.frame_names import check_names, frame_name, has_frame_holder
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..render import OpenedStage


@dataclass(frozen=True)
class Shot:
    """One picture and the files it is written to; `report`: the JSON file beside them."""

    settings: RenderSettings
    files: list[str]
    report: str | None = None


def moments(time_codes: list[float] | None) -> list[float | None]:
    """The frames asked for, or the stage's default time."""
    return [*time_codes] if time_codes else [None]


def product_shots(
    scene: str, settings: RenderSettings, asked: Sequence[str] | None, folder: str | None, time_codes: list[float] | None
) -> tuple[OpenedStage, list[Shot]]:
    """The stage, and every frame of the products asked for (None: all) under their own names in `folder`."""
    from ..render import open_once
    from ..render.products import products_of

    opened = open_once(scene, settings)
    shots = []
    for product in products_of(opened, settings, asked):
        name = frame_name(_numbered(product.file_name, time_codes))
        if time_codes is None and name.has_holder:  # the stage's author meant one
            raise SettingsError("the product's name holds a frame number; --frames says which", where=str(name), code="frames")
        check_names([name], time_codes)
        # Parts of an EXR, which other pictures cannot hold.
        asked_for = product.settings if name.pattern.lower().endswith(".exr") else replace(product.settings, aovs=())
        for time_code in moments(time_codes):
            shots.append(Shot(replace(asked_for, time_code=time_code), [str(Path(folder or "", name.of(time_code)))]))
    return opened, shots


def _numbered(name: str, time_codes: list[float] | None) -> str:
    """With a place for the frame's number where there are several."""
    path = Path(name)
    if time_codes is not None and len(time_codes) > 1 and not has_frame_holder(name):
        return f"{path.stem}.####{path.suffix}"
    return name
