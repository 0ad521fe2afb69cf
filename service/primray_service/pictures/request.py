"""Parameters of a picture of a preview. Pure: no numpy, since the server's process only passes them on."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

View = Literal["beauty", "error", "relative-error"]
Channel = Literal["rgb", "r", "g", "b", "a", "luminance"]
Format = Literal["png", "jpeg", "raw"]

# Colour spaces of pictures, by the ids that their files name.
Space = Literal[
    "lin_rec709_scene", "lin_ap1_scene", "lin_ap0_scene", "lin_p3d65_scene", "lin_rec2020_scene", "lin_adobergb_scene"
]

VIEWS: tuple[str, ...] = get_args(View)
MEDIA_TYPES = {"png": "image/png", "jpeg": "image/jpeg", "raw": "application/octet-stream"}
MOST_STOPS = 30.0  # of exposure, in both directions
MOST_WIDTH = 8192


@dataclass(frozen=True)
class PictureRequest:
    view: str = "beauty"
    channel: str = "rgb"
    exposure: float = 0.0
    format: str = "png"
    width: int | None = None
    # Display transform of the job's files, to which `exposure` is added.
    through: str | None = None
    display: str | None = None
    look: str | None = None
    stops: float | Literal["auto"] | None = None

    @property
    def tag(self) -> str:
        """Return a text that distinguishes requests, for an ETag."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]

    def as_json(self) -> dict[str, Any]:
        return asdict(self)
