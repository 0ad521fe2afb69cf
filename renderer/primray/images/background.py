"""Backgrounds: a colour or an image file, composited under the picture after rendering.

Colours and files with display values are display-referred: they are converted by the inverse of the default view, so that a
picture saved with that view shows them unchanged. Exposure applies to the picture in front of them (`Image.foreground`) and to
scene-linear files, which are assumed to be in Rec.709.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..color import color_space, ocio
from ..color.color_space import REC709, ColorSpace
from ..description import Frame
from ..errors import SettingsError
from .image import Foreground, Image

TRANSPARENT = "transparent"
_HEX = re.compile(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
LINEAR = (".exr", ".hdr")


@dataclass(frozen=True)
class Background:
    """A display-referred colour, or a file."""

    color: tuple[float, float, float] | None = None
    file: str | None = None

    def behind(self, pixels: Floats, frame: Frame, space: ColorSpace, scale: float = 1.0) -> Floats:
        """Return (H, W, 4) premultiplied pixels over this background, opaque. `scale` multiplies scene-linear files."""
        if self.color is not None:
            rgb = _over_shown(pixels, np.array([[self.color]], np.float32), space)
        else:
            assert self.file is not None
            under = _cropped(_covering(self.file, frame.resolution), frame)
            if self.file.lower().endswith(LINEAR):
                linear = scale * color_space.transformed(under, color_space.matrix(REC709, space))
                rgb = pixels[..., :3] + (1 - np.clip(pixels[..., 3:], 0, 1)) * linear
            else:
                rgb = _over_shown(pixels, under, space)
        return np.concatenate([rgb, np.ones_like(pixels[..., 3:])], axis=2).astype(np.float32)


def _over_shown(pixels: Floats, under: Floats, space: ColorSpace) -> Floats:
    """Return (H, W, 3) that shows the picture over display values (H, W, 3) or (1, 1, 3), mixed as light of the display.

    The radiance that a view shows as white may be a hundred times that of lit surfaces; mixed as radiance, it would swallow
    edges and shadows.
    """
    alpha = np.clip(pixels[..., 3:], 0, 1)
    straight = np.divide(pixels[..., :3], alpha, out=np.zeros_like(pixels[..., :3]), where=alpha > 0)
    shown = np.clip(ocio.to_display(straight, space=space), 0, 1)
    mixed = _encoded(alpha * _light(shown) + (1 - alpha) * _light(under))
    rgb = ocio.from_display(mixed.astype(np.float32), space)
    # Fully covered pixels are kept, and light without coverage is added to the background.
    return np.where(alpha == 1, pixels[..., :3], np.where(alpha == 0, rgb + pixels[..., :3], rgb))


def _light(shown: Floats) -> Floats:
    """Return display values decoded to linear light in 0 to 1 (IEC 61966-2-1, sRGB)."""
    return np.where(shown <= 0.04045, shown / 12.92, ((np.maximum(shown, 0) + 0.055) / 1.055) ** 2.4)


def _encoded(light: Floats) -> Floats:
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)


@dataclass(frozen=True, eq=False)
class Backdrop:
    """Everything under a render's picture: the shadow (H, W) received by a ground, and a background.

    A denoised picture has a denoised shadow.
    """

    shadow: Floats | None
    background: Background | None
    frame: Frame
    space: ColorSpace
    denoised_shadow: Floats | None = None
    lit_behind: bool = False  # a visible dome is behind the picture's surfaces, and the shadow is in front of it

    def behind(self, pixels: Floats, scale: float = 1.0) -> Floats:
        """Return (H, W, 4) premultiplied pixels with the backdrop behind them; `scale` as in `Background.behind`."""
        if self.shadow is not None:
            alpha = np.clip(pixels[..., 3:], 0, 1)
            opacity, rgb = (1 - alpha) * self.shadow[..., None], pixels[..., :3]
            # In partly covered pixels the light of surface and dome is not known separately: all is taken as the dome's.
            rgb = rgb * (1 - opacity) if self.lit_behind else rgb
            pixels = np.concatenate([rgb, alpha + opacity], axis=2)
        return pixels if self.background is None else self.background.behind(pixels, self.frame, self.space, scale)

    def exposed(self, pixels: Floats, stops: float) -> Floats:
        """Return the pixels brightened by `stops`, with the backdrop behind them; display-referred colours do not change."""
        scale = 2.0**stops
        with np.errstate(over="ignore"):
            lit = np.minimum(pixels[..., :3] * np.float32(scale), np.finfo(np.float32).max)
        return self.behind(np.concatenate([lit, pixels[..., 3:]], axis=2), scale)

    def behind_denoised(self, image: Image, coverage: Floats) -> Image:
        """Return the image with this backdrop behind its denoised picture, which has the film's coverage (H, W, 1)."""
        if image.denoised is None:
            return image
        under = self if self.denoised_shadow is None else replace(self, shadow=self.denoised_shadow)
        rendered = np.concatenate([image.denoised.pixels[..., :3], coverage], axis=2)
        made = replace(image.denoised, pixels=under.behind(rendered), foreground=Foreground(rendered, under.exposed))
        return replace(image, denoised=made)


def behind_previews(text: str | None, frame: Frame, space: ColorSpace) -> Backdrop | None:
    """Return the backdrop of progressive previews, or None if no background is set.

    It lacks the shadow of a ground, which is rendered last.
    """
    background = background_of(text)
    return None if background is None else Backdrop(None, background, frame, space)


def background_of(text: str | None) -> Background | None:
    """Return the background that a setting describes; None for no background and for `transparent`.

    SettingsError if it is neither a colour nor a file.
    """
    if text is None or text == TRANSPARENT:
        return None
    if _HEX.fullmatch(text):
        digits = text[1:] if len(text) == 7 else "".join(2 * digit for digit in text[1:])
        r, g, b = (int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4))
        return Background((r, g, b))
    if not os.path.exists(text) and (numbers := _numbers(text)) is not None:
        return Background(numbers)
    if os.path.isfile(text):
        return Background(file=text)
    sentence = (
        f"{text} is not a background; expected a colour as displayed (#rrggbb, such as #ffffff for white, or r,g,b in 0 to 1), "
        "transparent, or an existing file"
    )
    raise SettingsError(sentence, where="background", code="background")


def _numbers(text: str) -> tuple[float, float, float] | None:
    try:
        r, g, b = (float(number) for number in text.split(","))
    except ValueError:
        return None
    return (r, g, b) if all(math.isfinite(x) and 0 <= x <= 1 for x in (r, g, b)) else None


def _covering(file: str, resolution: tuple[int, int]) -> Floats:
    """Return the image scaled to cover the frame, and cropped at its longer sides."""
    import OpenImageIO as oiio

    image = oiio.ImageBuf(file)
    if not image.initialized or not image.read(force=True, convert=oiio.FLOAT):
        raise SettingsError(f"the background cannot be read: {image.geterror()}", where="background", code="background")
    width, height = resolution
    spec = image.spec()
    scale = max(width / spec.width, height / spec.height)
    wide, tall = max(width, round(spec.width * scale)), max(height, round(spec.height * scale))
    scaled = oiio.ImageBufAlgo.resize(image, roi=oiio.ROI(0, wide, 0, tall, 0, 1, 0, spec.nchannels))
    values = np.asarray(scaled.get_pixels(oiio.FLOAT), np.float32).reshape(tall, wide, spec.nchannels)
    rgb = values[..., :3] if spec.nchannels >= 3 else np.repeat(values[..., :1], 3, axis=2)
    left, top = (wide - width) // 2, (tall - height) // 2
    return rgb[top : top + height, left : left + width]


def _cropped(whole: Floats, frame: Frame) -> Floats:
    p = frame.pixels
    rows = np.clip(np.arange(p.y, p.y + p.height), 0, whole.shape[0] - 1)
    columns = np.clip(np.arange(p.x, p.x + p.width), 0, whole.shape[1] - 1)
    return whole[rows][:, columns]
