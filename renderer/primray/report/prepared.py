"""A render that is ready to sample: its scene, and what the stage and the machine made of the settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..settings import RenderSettings
from ..settings.in_stage import NOTHING_ASKED, StageSettings

if TYPE_CHECKING:
    from ..aov_names import AovRequest
    from ..core import CoreScene
    from ..description import Camera, Frame
    from ..description.picture_file import PictureFile
    from ..staging.ground_shadow import GroundShadow


@dataclass(frozen=True)
class Prepared:
    """A scene that is built, and what the stage and the machine made of the settings."""

    scene: CoreScene
    settings: RenderSettings
    counts: dict[str, int]
    camera: Camera
    frame: Frame
    fingerprint: dict[str, str]  # empty unless it was asked for
    aovs: tuple[AovRequest, ...] = ()
    lights: int = 0
    motion: dict[str, Any] | None = None  # what the report says of what moves
    left_out: dict[str, int] = field(default_factory=dict)  # where nothing is drawn: shapes by why, "" for unknown
    hidden_from_camera: bool = False  # all geometry, though it is there for other rays
    # Of a prim and of the instance that it is seen in, in a taxonomy, where AOVs ask for them.
    labels: Callable[[str, str, str], tuple[str, ...]] | None = None
    assets: dict[str, str] = field(default_factory=dict)  # by prim, where Cryptomatte asks for them
    stage: str = ""  # the root layer's file name, without folders
    ground_shadow: GroundShadow | None = None  # where a ground shows only its shadow
    file: PictureFile | None = None  # what the stage's product asks of the EXR
    asked: StageSettings = NOTHING_ASKED  # settings of the stage that the render follows
