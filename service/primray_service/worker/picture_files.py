"""How the files of a job are written: view, exposure, halves and compression, as its settings say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from primray.images.files.encoding import Encoding, compression_of

if TYPE_CHECKING:
    from primray.images.exposure import View
    from primray.images.image import Image


@dataclass(frozen=True)
class PictureFiles:
    """What OpenColorIO shows a picture through, and how an EXR stores it."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float | Literal["auto"] | None = None  # None: as the product asks
    encoding: Encoding = field(default_factory=Encoding)

    def view_of(self, image: Image) -> View:
        """Return the view of the image's files: the job's, else what the stage's product asks for."""
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
    """Return what the command's `files` say; SettingsError for a compression that no EXR has."""
    said = command.get("files") or {}
    encoding = Encoding(None, tuple(said.get("half", ())), *compression_of(said.get("compression")))
    return PictureFiles(said.get("view"), said.get("display"), said.get("look"), said.get("exposure"), encoding)
