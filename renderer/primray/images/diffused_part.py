"""The diffused picture as a part of an EXR beside its record."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

from .aov import Values
from .aov_parts import MEANING, PICTURE_PART, SOURCE

NAME = "diffused"
SAYS = "the picture as its lens diffuses it; errors of neighbours are not independent"


def diffused_part(
    picture: Any, values: Values, metadata: Mapping[str, str | int | float], taken: Container[str]
) -> tuple[Any, Values]:
    """An OIIO ImageSpec and its values, "diffused.R" to "diffused.stderr.B"; `picture` is the record's spec, whose channels
    these have. It gets a name."""
    import OpenImageIO as oiio

    part = oiio.ImageSpec(picture)
    part.channelnames = tuple(f"{NAME}.{channel}" for channel in picture.channelnames)
    for attribute in [a.name for a in picture.extra_attribs if a.name.startswith("primray:")]:
        part.erase_attribute(attribute)
    part.attribute("oiio:subimagename", NAME if NAME not in taken else f"primray.{NAME}")
    part.attribute(SOURCE, NAME)
    part.attribute(MEANING, SAYS)
    for name, value in metadata.items():
        part.attribute(f"primray:{name}", value)
    picture.attribute("oiio:subimagename", PICTURE_PART)
    return part, values
