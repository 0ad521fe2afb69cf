"""Settings of a job's picture files: view, exposure, half floats and compression."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from primray.images.encoding import Encoding, compression_of

if TYPE_CHECKING:
    from primray.images.exposure import View
    from primray.images.image import Image


@dataclass(frozen=True)
class PictureFiles:
    """OpenColorIO transform of pictures, and storage of an EXR."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float | Literal["auto"] | None = None  # None: as the product asks
    encoding: Encoding = field(default_factory=Encoding)

    def view_of(self, image: Image) -> View:
        """Return the view of the image's files: the job's, else the one that the stage's product requests."""
        return image.view_of(self.view, self.display, self.look)

    def stops(self, image: Image) -> float:
        """Return the exposure in stops; "auto" is what the view needs for this picture."""
        if self.exposure is None:
            return image.file.view.exposure
        if self.exposure != "auto":
            return self.exposure
        from primray.images.exposure import exposure_that_serves

        return exposure_that_serves(image.seen, self.view_of(image))


def picture_files_of(command: Mapping[str, Any]) -> PictureFiles:
    """Return the command's `files`; SettingsError for a compression that EXR does not have."""
    said = command.get("files") or {}
    encoding = Encoding(None, tuple(said.get("half", ())), *compression_of(said.get("compression")))
    return PictureFiles(said.get("view"), said.get("display"), said.get("look"), said.get("exposure"), encoding)
