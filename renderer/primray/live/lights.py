"""The lights of a viewed picture, weighed after the render as `primray relight` does it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..aovs import LIGHTS, light_path_of
from ..errors import SettingsError
from ..light_mix.mix import LightMix
from ..settings.light_mixes import checked_weight

if TYPE_CHECKING:
    from ..images.aov import Aov
    from ..images.image import Image
    from ..report.prepared import Prepared
    from ..sampling.sampling import Sampling

Weights = Mapping[str, tuple[float, float, float]]
PREFIX, PLAIN = f"{LIGHTS}.", (1.0, 1.0, 1.0)
MOST = 64  # weights in a command


def weights_of(given: object) -> Weights:
    """Return the weights of a command, by the names of lights, checked."""
    if not isinstance(given, dict) or len(given) > MOST:
        raise SettingsError(f"weights must be an object of at most {MOST} names with weights", code="view-command")
    try:
        return {str(name): checked_weight(str(name), weight) for name, weight in given.items()}
    except (TypeError, ValueError):
        raise SettingsError("a weight is a number, or a list of three", code="view-command") from None


def lights_so_far(prepared: Prepared, sampling: Sampling) -> dict[str, Aov]:
    """Return the light of each light in the samples so far; nothing where it was not asked for."""
    from ..images.light_path_aovs import light_paths_of_film

    routed = [request for request in prepared.aovs if light_path_of(request.source) is not None]
    return light_paths_of_film(prepared.scene, routed, sampling.film) if routed else {}


class ShownLights:
    """Mixes of the lights of a picture, which are read once."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self._mix: LightMix | None = None
        self.relmse: list[float] | None = None  # of the mix that was made last

    def mixed(self, image: Image, weights: Weights) -> Image:
        """Return the picture with its lights weighed; itself where it was not rendered with them, or no weight is another.

        Names that it does not have are weights of another time or variant.
        """
        self.relmse = None
        self.names = [name.removeprefix(PREFIX) for name in image.aovs if name.startswith(PREFIX)]
        there = {name: weights[name] for name in self.names if weights.get(name, PLAIN) != PLAIN}
        if not there:
            self._mix = None
            return image
        if self._mix is None or self._mix.image is not image:
            self._mix = LightMix.of(image)
        found = self._mix.mixed(there)
        error = found.report["error"]
        self.relmse = None if error is None else [error["relmse"]["estimate"], *error["relmse"]["ci95"]]
        return found

    def as_json(self, weights: Weights) -> dict[str, Any]:
        return {"names": list(self.names), "weights": {name: list(w) for name, w in weights.items()}, "relmse": self.relmse}
