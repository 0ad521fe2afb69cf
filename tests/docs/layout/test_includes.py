"""A gate: no folders of the core that include each other, and no include of what is not there."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from .imports import circles
from .includes import core_sources, folder_graph

ROOT = Path(__file__).resolve().parents[3]


def test_no_folders_of_the_core_include_each_other() -> None:
    assert circles(folder_graph(core_sources(ROOT))) == []


def test_folders_that_include_each_other_are_found() -> None:
    made = {
        PurePosixPath("light/light.hpp"): '#include "light/dome/dome.hpp"\n',
        PurePosixPath("light/dome/dome.hpp"): '#include "math/vec3.hpp"\n#include "light/cdf.hpp"\n',
        PurePosixPath("math/vec3.hpp"): "#include <cmath>\n",
    }
    assert circles(folder_graph(made)) == [["light", "light/dome"]]


def test_what_is_included_is_there() -> None:
    sources = core_sources(ROOT)
    assert {folder for folder in folder_graph(sources) if not (ROOT / "renderer" / "core" / folder).is_dir()} == set()
