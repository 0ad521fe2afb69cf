"""Which picture of a preview is asked for. Pure: no numpy, since the server's process only passes it on."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

View = Literal["beauty", "error", "relative-error"]
Channel = Literal["rgb", "r", "g", "b", "a", "luminance"]
Format = Literal["png", "jpeg", "raw"]

# That pictures can be in, by the ids that their files name.
Space = Literal[
    "lin_rec709_scene", "lin_ap1_scene", "lin_ap0_scene", "lin_p3d65_scene", "lin_rec2020_scene", "lin_adobergb_scene"
]

VIEWS: tuple[str, ...] = get_args(View)
MEDIA_TYPES = {"png": "image/png", "jpeg": "image/jpeg", "raw": "application/octet-stream"}
MOST_STOPS = 30.0  # of exposure, each way
MOST_WIDTH = 8192


@dataclass(frozen=True)
class PictureRequest:
    view: str = "beauty"
    channel: str = "rgb"
    exposure: float = 0.0
    format: str = "png"
    width: int | None = None
    # What the job's files are seen through, which `exposure` is added to.
    through: str | None = None
    display: str | None = None
    look: str | None = None
    stops: float | Literal["auto"] | None = None

    @property
    def tag(self) -> str:
        """Tells requests apart, in an ETag."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]

    def as_json(self) -> dict[str, Any]:
        return asdict(self)
