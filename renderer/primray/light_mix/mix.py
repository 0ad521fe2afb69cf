"""A picture with its lights weighed anew: the light of each light times its weight, added, with the error of that sum.

Light is linear in what each light emits, channel by channel, so intensity, exposure and colour can change after a render; a
light's size, shape and place, and the turn of a dome, cannot. Each part comes with the signed difference of the two replicates
(`Aov.differences`). The difference of a weighted sum is the weighted sum of differences, so its magnitude is the mix's standard
error with all covariances of the parts, at one degree of freedom per pixel.

The choice of lights to sample followed the old intensities: a light that is made much brighter brings its noise along, as the
error says.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..aovs import LIGHTS
from ..arrays import Doubles
from ..errors import SettingsError, did_you_mean
from ..images.exr_parts import LIGHTS_OF_PART
from ..images.image import Image
from ..images.reading import read_image
from ..report.report import header_of
from ..sampling.error import Estimate
from ..settings.light_mixes import Weight, checked_weight

STORED_APART = 2.0**-9  # parts and picture may be stored with other precisions: halves have 11 bits


@dataclass(frozen=True, eq=False)
class LightPart:
    """The light of some lights: `light` and `difference` (H, W, 3), scaled as the picture; `paths` of their prims."""

    name: str
    light: Doubles
    difference: Doubles
    paths: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class LightMix:
    """A picture and the light of its lights, rendered with the output `lights`.

    >>> image = primray.render("shot.usda", aovs=["lights"], resolution=(32, 18), spp=4)
    >>> mix = primray.LightMix.of(image)
    >>> mix.names
    ('sun', 'sky', 'rest')
    >>> dimmed = mix.mixed({"sun": 0.5, "sky": (1, 0.8, 0.6)})
    >>> dimmed.save("dimmed.exr").name
    'dimmed.exr'
    """

    image: Image
    parts: tuple[LightPart, ...]

    @classmethod
    def of(cls, picture: Image | str | os.PathLike[str]) -> LightMix:
        """Return the mix of a picture, or of its EXR.

        SettingsError `lights-missing` if it was rendered without the output `lights`.
        """
        image = picture if isinstance(picture, Image) else read_image(picture)
        parts = []
        for name, aov in image.aovs.items():
            if aov.differences is None or not name.startswith(f"{LIGHTS}."):
                continue
            paths = json.loads(aov.metadata.get(LIGHTS_OF_PART, "[]"))
            difference = np.asarray(aov.differences, np.float64)
            parts.append(
                LightPart(name.removeprefix(f"{LIGHTS}."), np.asarray(aov.values, np.float64), difference, tuple(paths))
            )
        if not parts:
            where = "" if isinstance(picture, Image) else os.fspath(picture)
            sentence = "the picture does not hold the light of its lights: render it with --aov lights, as an EXR"
            raise SettingsError(sentence, where=where, code="lights-missing")
        return cls(image, tuple(parts))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(part.name for part in self.parts)

    def weights(self, asked: Mapping[str, Weight]) -> dict[str, tuple[float, float, float]]:
        """Return weights for R, G and B of each part: those asked for, else 1. SettingsError if one is unknown or negative."""
        found = dict.fromkeys(self.names, (1.0, 1.0, 1.0))
        for name, weight in asked.items():
            if name not in found:
                near = did_you_mean(name, self.names)
                sentence = (
                    f"there is no light {name!r} in the picture; {near + ' It' if near else 'it'} has {', '.join(self.names)}"
                )
                raise SettingsError(sentence, where=name, code="lights-unknown")
            found[name] = checked_weight(name, weight)
        return found

    def mixed(self, asked: Mapping[str, Weight]) -> Image:
        """Return the picture with lights weighed: a factor for each name, or three for its R, G and B; others stay as they are.

        Alpha, the frame and the header stay; outputs beside the picture, and denoised or diffused pictures, are left out.
        Weights of 1 give the picture's own bits. `report["relight"]` has the weights, `report["error"]["relmse"]` the error.
        """
        weights = self.weights(asked)
        light, difference = np.zeros_like(self.parts[0].light), np.zeros_like(self.parts[0].difference)
        for part in self.parts:
            light += part.light * weights[part.name]
            difference += part.difference * weights[part.name]
        left, apart = self.beside
        light, difference = light * left + apart, difference * left
        changed = {name: list(weight) for name, weight in weights.items() if weight != (1.0, 1.0, 1.0)}
        colors = light.astype(np.float32) if changed else self.image.pixels[..., :3]  # parts may be stored as halves
        pixels = np.concatenate([colors, self.image.pixels[..., 3:]], axis=2)
        errors = np.where(np.isnan(difference), np.inf, np.abs(difference)).astype(np.float32)
        error = relative_error(light, difference)
        report: dict[str, Any] = {"relight": changed, "error": None if error is None else {"relmse": error.as_json()}}
        metadata = {
            **_without_errors(self.image.metadata),
            **({} if error is None else header_of({"error": report["error"]})),
            **{f"relight.{name}": " ".join(f"{w:.9g}" for w in row) for name, row in changed.items()},
        }
        return replace(
            self.image,
            pixels=pixels,
            errors=errors,
            report=report,
            metadata=metadata,
            aovs={},
            denoised=None,
            diffused=None,
            deep=None,
            foreground=None,
        )

    def with_part(self, part: LightPart, told: Mapping[str, float]) -> LightMix:
        """Return the mix with another part in place of that of the same name, and `told` in the header of its picture."""
        parts = tuple(part if one.name == part.name else one for one in self.parts)
        left, apart = self.beside
        light = np.sum([one.light for one in parts], axis=0) * left + apart
        difference = np.sum([one.difference for one in parts], axis=0) * left
        name = f"{LIGHTS}.{part.name}"
        aov = replace(self.image.aovs[name], values=part.light, differences=part.difference.astype(np.float32))
        image = replace(
            self.image,
            pixels=np.concatenate([light.astype(np.float32), self.image.pixels[..., 3:]], axis=2),
            errors=np.where(np.isnan(difference), np.inf, np.abs(difference)).astype(np.float32),
            aovs={**self.image.aovs, name: aov},
            metadata={**_without_errors(self.image.metadata), **{f"relight.{key}": value for key, value in told.items()}},
        )
        return LightMix(image, parts)

    @cached_property
    def beside(self) -> tuple[Doubles, Doubles]:
        """What the picture does to the sum of its parts: a factor where it has less light, as in the shadow on an invisible
        ground, and what it adds where it has more, such as a back plate, which stays as it is."""
        total = np.sum([part.light for part in self.parts], axis=0)
        rest = self.image.pixels[..., :3].astype(np.float64) - total.astype(np.float32)
        rest = np.where(np.abs(rest) <= STORED_APART * np.abs(total), 0.0, rest)
        left = np.ones_like(total)
        np.divide(total + rest, total, out=left, where=(rest < 0) & (total > 0))
        return np.maximum(left, 0.0), np.where((rest < 0) & (total > 0), 0.0, rest)

    @property
    def outside(self) -> Doubles:
        """The light (H, W, 3) of the picture that is in no part, and so is not weighed."""
        return self.beside[1]

    @property
    def keeps_light(self) -> bool:
        """Whether some light of the picture is in no part, and so is not weighed."""
        return bool(self.outside.any())

    def share_of(self, part: LightPart) -> float:
        """Return the share of the picture's light, by the sum of its channels, that a part holds."""
        total = float(sum(one.light.sum() for one in self.parts))
        return float(part.light.sum()) / total if total > 0 else 0.0


def _without_errors(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return the header without errors of the picture, which are not those of a mix."""
    return {key: value for key, value in header.items() if not key.startswith("error.")}


def relative_error(light: Doubles, difference: Doubles) -> Estimate | None:
    """Return relMSE (sampling/error.py) of a picture with the differences of its replicates; None if a pixel has no estimate.

    Each squared difference d^2 has one degree of freedom, so the variance of a sum of them is 2/3 of the sum of d^4.
    """
    if not np.isfinite(difference).all():
        return None
    terms = difference**2 / (light**2 + 0.01)
    total = float(terms.sum())
    if total == 0:
        return Estimate(0.0, 0.0, 0.0)
    of_pixels = terms.sum(axis=2)  # channels of a pixel share its samples
    chance = math.sqrt(2 / 3 * float((of_pixels**2).sum())) / total
    return Estimate.of_replicates(total / terms.size, chance)


def relight(picture: Image | str | os.PathLike[str], weights: Mapping[str, Weight]) -> Image:
    """Return a picture, rendered with the output `lights`, with its lights weighed anew; see `LightMix.mixed`.

    >>> image = primray.render("shot.usda", aovs=["lights"], resolution=(32, 18), spp=4)
    >>> primray.relight(image, {"sky": 0.5}).resolution
    (32, 18)
    """
    return LightMix.of(picture).mixed(weights)
