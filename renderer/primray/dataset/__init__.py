"""Data sets: pictures of one stage in which poses, materials, lights, cameras and more vary, with labels, in known formats.

    >>> config = primray.dataset.Config.of(
    ...     {
    ...         "stage": "shot.usda",
    ...         "samples": 3,
    ...         "settings": {"resolution": [32, 18], "spp": 2},
    ...         "vary": {"sun": {"attribute": "/sun.inputs:intensity", "to": {"uniform": [1, 4]}}},
    ...     }
    ... )
    >>> made = primray.dataset.make(config, "suns", processes=2)
    >>> [sample.index for sample in primray.dataset.samples_of("suns")]
    [0, 1, 2]

Every sample is a function of the config's seed, its index, and the names of what varies. docs/datasets.md describes configs.
"""

from ..pinned.difference import Difference
from .config import Config, Labels
from .draws import Draws
from .making import Made, make
from .packing import Sample, samples_of
from .ray_workers import RayWorkers
from .sampler import Sampler
from .verification import Verification, verify
from .workers import LocalWorkers, SampleExecutor

__all__ = [
    "Config",
    "Difference",
    "Draws",
    "Labels",
    "LocalWorkers",
    "Made",
    "RayWorkers",
    "Sample",
    "SampleExecutor",
    "Sampler",
    "Verification",
    "make",
    "samples_of",
    "verify",
]
