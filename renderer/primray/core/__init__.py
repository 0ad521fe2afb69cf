"""The C++ core as seen from Python: the compiled module in use, scenes built in it, films, and passes that render into them.

`native` chooses the compiled module, `compiled` has its names and types, `scene` uploads a description to it, `film` and
`passes` take samples and render the data of first hits for AOVs.
"""

from . import compiled
from .film import REMOVALS, TILE, Film, samples_of_replicates, uniform_ends
from .native import (
    DEFAULT_LANES,
    ISA_FLAGS,
    NO_DEPTH_LIMIT,
    build_digest,
    isa,
    lanes,
    load,
    max_depth,
    module,
    runnable_isas,
    threads,
    versions,
)
from .passes import (
    FilmSamples,
    Pass,
    PickedPoint,
    Progress,
    Recording,
    choose_splits,
    coverage,
    first_hits,
    log_pixel,
    pick,
    render,
    render_pass,
)
from .scene import CoreScene, Splits, build, dice

__all__ = [
    "DEFAULT_LANES",
    "ISA_FLAGS",
    "NO_DEPTH_LIMIT",
    "REMOVALS",
    "TILE",
    "CoreScene",
    "Film",
    "FilmSamples",
    "Pass",
    "PickedPoint",
    "Progress",
    "Recording",
    "Splits",
    "build",
    "build_digest",
    "choose_splits",
    "compiled",
    "coverage",
    "dice",
    "first_hits",
    "isa",
    "lanes",
    "load",
    "log_pixel",
    "max_depth",
    "module",
    "pick",
    "render",
    "render_pass",
    "runnable_isas",
    "samples_of_replicates",
    "threads",
    "uniform_ends",
    "versions",
]
