"""Phase functions in double precision, as their papers print them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

DROPLETS = 2.0  # what the core's number of a phase function has beside the diameter


def henyey_greenstein(cosine: Any, g: float) -> Any:
    """Return the density; the cosine is 1 straight ahead."""
    return (1 - g * g) / (4 * math.pi * ((1 - g) ** 2 + 2 * g * (1 - np.asarray(cosine))) ** 1.5)


def draine(cosine: Any, g: float, alpha: float) -> Any:
    """Draine 2003, equation 7."""
    c = np.asarray(cosine)
    return henyey_greenstein(c, g) * (1 + alpha * c * c) / (1 + alpha * (1 + 2 * g * g) / 3)


def lobes(d: float) -> tuple[float, float, float, float]:
    """Return both g, alpha and Draine's weight for a diameter in micrometres (Jendersie and d'Eon 2023)."""
    if d <= 0.1:
        return 13.8 * d * d, 1.1456 * d * math.sin(9.29044 * d), 250.0, 0.252977 - 312.983 * d**4.3
    ln = math.log(d)
    if d < 1.5:
        inner = 1.19692 * math.cos((ln - 0.238604) * (ln + 1.00667) / (0.507522 - 0.15677 * ln))
        broad = 0.379685 * math.cos(inner + 1.37932 * ln + 0.0625835) + 0.344213
        return 0.862 - 0.143 * ln**2, broad, 250.0, 0.146209 * math.cos(3.38707 * ln + 2.11193) + 0.316072 + 0.0778917 * ln
    if d < 5:
        broad = 0.500411 - 0.081287 / (-2 * ln + math.tan(ln) + 1.27551)
        weight = 0.026914 * (ln - math.cos(5.68947 * (math.log(ln) - 0.0292149))) + 0.376475
        return 0.0604931 * math.log(ln) + 0.940256, broad, 7.30354 * ln + 6.31675, weight
    return (
        math.exp(-0.0990567 / (d - 1.67154)),
        math.exp(-2.20679 / (d + 3.91029) - 0.428934),
        math.exp(3.62489 - 8.29288 / (d + 5.52825)),
        math.exp(-0.599085 / (d - 0.641583) - 0.665888),
    )


def droplets(cosine: Any, diameter: float) -> Any:
    """Return the density of water droplets' phase function."""
    g, broad, alpha, weight = lobes(diameter)
    return (1 - weight) * henyey_greenstein(cosine, g) + weight * draine(cosine, broad, alpha)
