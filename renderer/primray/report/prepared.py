"""A render that is ready to sample: the built scene, and the settings as resolved by stage and machine."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..settings import RenderSettings
from ..settings.stage_settings import NOTHING_ASKED, StageSettings

if TYPE_CHECKING:
    from ..aovs import AovRequest
    from ..arrays import Doubles
    from ..core import CoreScene
    from ..description import Camera, Frame
    from ..description.picture_file import PictureFile
    from ..labels.table import LabelTable
    from ..staging import GroundShadow
    from ..usd import LabelledPrims


@dataclass(frozen=True)
class Prepared:
    """A built scene with the settings as resolved by stage and machine."""

    scene: CoreScene
    settings: RenderSettings
    counts: dict[str, int]
    camera: Camera
    frame: Frame
    fingerprint: dict[str, str]  # empty unless requested
    aovs: tuple[AovRequest, ...] = ()
    lights: int = 0
    motion: dict[str, Any] | None = None  # motion statistics of the report
    left_out: dict[str, int] = field(default_factory=dict)  # if nothing is drawn: shape counts by reason, "" for unknown
    hidden_from_camera: bool = False  # all geometry is hidden from camera rays
    labelled: LabelledPrims | None = None  # semantic labels; None unless an AOV needs them
    label_table: LabelTable | None = None  # ids of classes, if labels are needed
    assets: dict[str, str] = field(default_factory=dict)  # asset name by prim path, if Cryptomatte needs it
    rolls: bool = False  # the shutter is rolling
    stage: str = ""  # file name of the root layer, without folders
    ground_shadow: GroundShadow | None = None  # set if a ground shows only its shadow
    file: PictureFile | None = None  # EXR settings of the stage's product
    asked: StageSettings = NOTHING_ASKED  # the stage's own render settings
    mixes: Doubles | None = None  # (M, E, 3) of lights, whose error the target applies to (sampling/mix_weights.py)
