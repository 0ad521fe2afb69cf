"""MaterialX's primitive nodes, as its own library lists them: definitions that no node graph implements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import pytest

mx = pytest.importorskip("MaterialX")

DEVELOPERS = {"osl_set_ci"}  # of a generator's own


@dataclass(frozen=True)
class Definition:
    name: str
    category: str
    inputs: tuple[tuple[str, str, str], ...]  # name, type, value or name of geometry
    outputs: tuple[tuple[str, str], ...]  # name, type


@cache
def primitives() -> tuple[Definition, ...]:
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    by_graph = {graph.getNodeDefString() for graph in library.getNodeGraphs()}
    by_graph |= {i.getNodeDefString() for i in library.getImplementations() if i.getNodeGraph()}
    return tuple(
        Definition(
            d.getName(),
            d.getNodeString(),
            tuple((i.getName(), i.getType(), i.getDefaultGeomPropString() or i.getValueString()) for i in d.getActiveInputs()),
            tuple((o.getName(), o.getType()) for o in d.getActiveOutputs()),
        )
        for d in library.getNodeDefs()
        if d.getName() not in by_graph and d.getNodeString() not in DEVELOPERS
    )
