"""What every adapter is given: the stage, what of it is asked for, and where diagnostics and shared results go."""

from __future__ import annotations

from dataclasses import dataclass, field

from pxr import Usd

from ...color.color_space import REC709, ColorSpace
from ...diagnostics import Diagnostics
from ...settings import RenderSettings
from ..moving.foreseen import UNSEEN, Foreseen
from ..moving.stands import Stands
from ..moving.timing import AT_FRAME, Timing
from ..querying.light_groups import NO_GROUPS, LightGroups
from .color_scope import ColorScope
from .kept import Kept
from .read import When
from .surface_table import SurfaceTable


@dataclass(frozen=True)
class Context:
    """Fixed for all that are given it; translation goes on with a copy where more has been found out."""

    stage: Usd.Stage
    settings: RenderSettings
    when: When
    purposes: tuple[str, ...]
    material_purposes: tuple[str, ...]
    diagnostics: Diagnostics
    timing: Timing = AT_FRAME  # when the shutter is open
    foreseen: Foreseen = UNSEEN  # and how large things are seen then
    stands: Stands | None = None  # where what is translated stands in the world, while the shutter is open
    rendering_space: ColorSpace = REC709
    aov_primvars: tuple[str, ...] = ()  # that AOVs ask for, without their namespace
    light_groups: LightGroups = NO_GROUPS  # that render settings say
    levels_chosen: bool = False  # of detail: there is one of each
    names_instances: bool = False  # an AOV asks for instances
    primvars_read: frozenset[str] = frozenset()  # "primvars:NAME" of all that materials of the stage read
    color_primvars: frozenset[str] = frozenset()  # of these, what colours read; and what is shown without a material
    shares: frozenset[str] = frozenset()  # prim paths that more than one prototype holds
    outer_colors: tuple[tuple[str, ColorScope], ...] = ()  # by prototype, around the material that is translated
    prototype_names: dict[str, str] = field(default_factory=dict)  # /__Prototype_N -> its first instance, as they are met
    surfaces: SurfaceTable = field(default_factory=SurfaceTable)
    kept: Kept = field(default_factory=Kept)

    def shown(self, path: str) -> str:
        """A path as users know it: what lies in a prototype by its first instance, since USD numbers prototypes as it likes."""
        if not path.startswith("/__Prototype_"):
            return path
        root, slash, rest = path[1:].partition("/")
        return self.prototype_names.get(f"/{root}", f"/{root}") + slash + rest

    def warn(self, code: str, path: str, message: str, attribute: str = "") -> None:
        self.diagnostics.add(code, path, message, attribute)
