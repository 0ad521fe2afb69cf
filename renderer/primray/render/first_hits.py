"""What a camera sees first: AOVs and labelled things of a stage, without light and without a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..aovs import AovRequest, needs_light
from ..errors import SettingsError
from .prepare import prepare
from .render import find_aovs

if TYPE_CHECKING:
    from ..camera import Camera
    from ..diagnostics import Diagnostics
    from ..images.aov import Aov
    from ..labels.things import Thing
    from ..report.report import Costs
    from ..settings import RenderSettings
    from .prepare import OpenedStage, Steps


@dataclass(frozen=True, eq=False, repr=False)
class FirstHits:
    """AOVs and labelled things, to the bit those of a render with the same settings. Row 0 is the top.

    >>> scene = primray.Scene("shot.usda")
    >>> seen = scene.first_hits(resolution=(32, 18), aovs=["depth", "object_instance:class"])
    >>> seen.aovs["depth"].values.shape
    (18, 32, 1)
    """

    aovs: Mapping[str, Aov]
    report: Mapping[str, Any]  # `labels` and `diagnostics`, as a render's report has them
    camera: Camera
    resolution: tuple[int, int]  # width, height

    @property
    def things(self) -> tuple[Thing, ...]:
        """The labelled things of an AOV object_instance:TAXONOMY, like `Image.things`."""
        from ..labels.things import thing_of_json

        return tuple(thing_of_json(says) for says in self.report.get("labels", {}).get("things", ()))

    def mask_of(self, thing: Thing) -> npt.NDArray[np.bool_]:
        """Return the pixels (H, W) that show a thing, or another that it holds. KeyError without the AOV of its taxonomy."""
        from ..labels.things import mask_of

        return mask_of(thing, self.things, self.aovs)


def first_hits_of_opened(
    opened: OpenedStage, settings: RenderSettings, costs: Costs, diagnostics: Diagnostics, steps: Steps | None = None
) -> FirstHits:
    """Return what a camera sees first; `steps` as for `prepare`. SettingsError for AOVs that are made of light."""
    prepared = prepare(opened.stage, opened.diagnostics, settings, costs, diagnostics, steps=steps)
    _refuse_light(prepared.aovs)
    aovs, of_labels = find_aovs(prepared, None, costs, diagnostics)
    width, height = prepared.scene.resolution
    report: dict[str, Any] = {"diagnostics": [diagnostic.as_json() for diagnostic in diagnostics]}
    report |= {"labels": of_labels} if of_labels else {}
    return FirstHits(aovs, report, prepared.camera, (width, height))


def _refuse_light(requests: Sequence[AovRequest]) -> None:
    for request in requests:
        if needs_light(request.source):
            raise SettingsError(
                f"{request.source} is made of the samples of a render: leave it out, or render a picture",
                where="aovs",
                code="aov-needs-light",
            )
