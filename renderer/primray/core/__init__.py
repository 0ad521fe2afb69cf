"""The C++ core as seen from Python: the compiled module in use, scenes built in it, films, and passes that render into them.

`isa_class` chooses the compiled module, `building` uploads a description to it, `film` and `passes` take samples,
`first_hit_planes` renders the data of first hits for AOVs.
"""

from .building import build, dice
from .film import REMOVALS, TILE, Film, samples_of_replicates, uniform_ends
from .first_hit_planes import FilmSamples, coverage, first_hits
from .isa_class import DEFAULT_LANES, ISA_FLAGS, build_digest, isa, lanes, load, module, runnable_isas, versions
from .limits import NO_DEPTH_LIMIT, max_depth, threads
from .passes import Pass, Progress, Recording, choose_splits, render, render_pass
from .scene import CoreScene, Splits

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
    "Progress",
    "Recording",
    "Splits",
    "build",
    "build_digest",
    "choose_splits",
    "coverage",
    "dice",
    "first_hits",
    "isa",
    "lanes",
    "load",
    "max_depth",
    "module",
    "render",
    "render_pass",
    "runnable_isas",
    "samples_of_replicates",
    "threads",
    "uniform_ends",
    "versions",
]
