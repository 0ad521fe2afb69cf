"""Pictures derived from the record, as parts of an EXR beside it: with lens diffusion, or denoised."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

from .aov import Values
from .aov_parts import MEANING, PICTURE_PART, SOURCE

DIFFUSED, DENOISED = "diffused", "denoised"
SAYS = {
    DIFFUSED: "the picture as its lens diffuses it; errors of neighbours are not independent",
    DENOISED: "the picture denoised: biased, for looking at; its error is in the header and the report",
}


def picture_beside(
    name: str, picture: Any, values: Values, metadata: Mapping[str, str | int | float], taken: Container[str]
) -> tuple[Any, Values]:
    """Return an OIIO ImageSpec and values with channels "diffused.R" to "diffused.stderr.B", as many as there are.

    `picture` is the spec of the record, which is given a part name.
    """
    import OpenImageIO as oiio

    part = oiio.ImageSpec(picture)
    part.nchannels = values.shape[2]
    part.channelnames = tuple(f"{name}.{channel}" for channel in picture.channelnames[: values.shape[2]])
    for attribute in [a.name for a in picture.extra_attribs if a.name.startswith("primray:")]:
        part.erase_attribute(attribute)
    part.attribute("oiio:subimagename", name if name not in taken else f"primray.{name}")
    part.attribute(SOURCE, name)
    part.attribute(MEANING, SAYS[name])
    for key, value in metadata.items():
        part.attribute(f"primray:{key}", value)
    picture.attribute("oiio:subimagename", PICTURE_PART)
    return part, values
