"""ShapingAPI by its text: a factor on radiance that depends on the direction of emission alone, and where it breaks.

Readings: the axis is -Z of the light as it stands in the world, and cone and focus measure angles in the world; an IES file
is read "in the light's local space", the direction taken through the inverse of the light's whole transform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pxr import Usd, UsdLux
from tests.reference.photometry import Photometry, read_photometry

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Shaping:
    focus: float
    tint: Doubles  # (3,)
    cutoff: float  # radians
    softness: float
    photometry: Photometry | None
    angle_scale: float
    ies_normalize: bool

    @property
    def smooth_start(self) -> float:
        return self.cutoff * (1 - min(max(self.softness, 0.0), 1.0))

    @property
    def cone_angles(self) -> list[float]:
        """Angles off the world's axis at which the factor breaks."""
        angles = {self.cutoff, self.smooth_start}
        return sorted(a for a in angles if 0 < a < np.pi)

    @property
    def profile_cones(self) -> list[tuple[Doubles, float]]:
        """In the light's space."""
        return [] if self.photometry is None else self.photometry.cones(self.angle_scale)

    @property
    def profile_planes(self) -> list[Doubles]:
        return [] if self.photometry is None else self.photometry.planes()

    def factor(self, cosine: Doubles, local: Doubles) -> Doubles:
        """(..., 3) for the cosine off the axis in the world (...) and directions in the light's space (..., 3)."""
        out = np.ones((*cosine.shape, 3))
        if self.focus > 0:
            f = np.abs(cosine)[..., None] ** self.focus
            out = out * (f + (1 - f) * self.tint)
        theta = np.arccos(np.clip(cosine, -1, 1))
        soft = np.zeros_like(theta)
        if self.smooth_start < self.cutoff:
            x = np.clip((theta - self.smooth_start) / (self.cutoff - self.smooth_start), 0, 1)
            soft = x * x * (3 - 2 * x)
        out = out * np.where(theta > self.cutoff, 0.0, 1 - soft)[..., None]
        if self.photometry is not None:
            d = local / np.linalg.norm(local, axis=-1, keepdims=True)
            power = self.photometry.power if self.ies_normalize else 1.0
            out = out * (self.photometry.candela_at(d, self.angle_scale) / power)[..., None]
        return out


def read_shaping(prim: Usd.Prim) -> Shaping | None:
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return None
    api = UsdLux.ShapingAPI(prim)
    file = api.GetShapingIesFileAttr().Get()
    return Shaping(
        max(float(api.GetShapingFocusAttr().Get()), 0.0),
        np.array(api.GetShapingFocusTintAttr().Get(), float),
        float(np.radians(api.GetShapingConeAngleAttr().Get())),
        float(api.GetShapingConeSoftnessAttr().Get()),
        read_photometry(file.resolvedPath or file.path) if file and file.path else None,
        float(api.GetShapingIesAngleScaleAttr().Get()),
        bool(api.GetShapingIesNormalizeAttr().Get()),
    )
