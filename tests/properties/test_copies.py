"""What is written to a copy of a stage reaches the prims that it is for alone, or is refused; on an isolated stage it always is
for them alone.

The oracle is the untouched stage: every other prim, in native instances by its proxies, has the composed values that it had.
"""

from __future__ import annotations

import random
from typing import Any

import pytest
from pxr import Sdf, Usd

from primray.usd.stage.edits import OpinionsLeak, check_reach, editable, isolated_copy
from primray.usd.stage.open import scratch_copy

from .random_arcs import stage_of

STAGES = 240
LOOKED_AT = (Usd.TimeCode.Default(), 0, 1, 4.5, 20)
THERE = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
Values = dict[Sdf.Path, dict[str, Any]]
Edits = list[tuple[Sdf.Path, str]]


def values(stage: Usd.Stage) -> Values:
    """By path: what a prim is, its attributes' values and its relationships' targets."""
    found: Values = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), THERE):
        if prim.GetName().startswith("Flattened_Prototype") or str(prim.GetPath()).startswith("/Flattened_Prototype"):
            continue
        what: dict[str, Any] = {"": (prim.GetTypeName(), prim.IsDefined(), prim.IsAbstract(), prim.GetAppliedSchemas())}
        what |= {a.GetName(): [a.Get(time) for time in LOOKED_AT] for a in prim.GetAuthoredAttributes()}
        what |= {rel.GetName(): rel.GetTargets() for rel in prim.GetAuthoredRelationships()}
        found[prim.GetPath()] = what
    return found


def instances(stage: Usd.Stage) -> set[Sdf.Path]:
    return {prim.GetPath() for prim in Usd.PrimRange(stage.GetPseudoRoot(), THERE) if prim.IsInstance()}


def edit(stage: Usd.Stage, r: random.Random) -> Edits:
    """Edits of a few prims: a value, a prim taken out, a new child. OpinionsLeak where others would change."""
    paths = [prim.GetPath() for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())][1:]
    done: Edits = []
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for path in r.sample(paths, min(len(paths), r.randint(1, 3))):
            kind = r.choice(["value", "value", "out", "child"])
            if not stage.GetPrimAtPath(path) or any(path.HasPrefix(other) for other, what in done if what == "out"):
                continue
            prim = editable(stage, path)
            if kind == "value":
                prim.CreateAttribute("user:x", Sdf.ValueTypeNames.Double).Set(77.0)
            elif kind == "out":
                prim.SetActive(False)
            elif prim.IsInstance() or not prim.IsActive():
                continue
            else:
                stage.DefinePrim(path.AppendChild("made"), "Cube")
            done.append((path, kind))
    check_reach(stage)
    return done


def is_meant(path: Sdf.Path, edits: Edits) -> bool:
    meant = {
        "value": lambda of: path == of,
        "out": lambda of: path.HasPrefix(of),
        "child": lambda of: path == of.AppendChild("made"),
    }
    return any(meant[kind](of) for of, kind in edits)


def not_meant(before: Values, after: Values, edits: Edits) -> list[Sdf.Path]:
    changed = (path for path in before.keys() | after.keys() if before.get(path) != after.get(path))
    return sorted(path for path in changed if not is_meant(path, edits))


@pytest.mark.parametrize("start", range(0, STAGES, STAGES // 4))
def test_edits_reach_what_they_name(start: int) -> None:
    refused = 0
    for seed in range(start, start + STAGES // 4):
        stage = stage_of(random.Random(seed))
        before = values(stage)
        copy = scratch_copy(stage)
        try:
            edits = edit(copy, random.Random(seed))
        except OpinionsLeak:
            refused += 1
        else:
            assert not_meant(before, values(copy), edits) == [], seed
        alone = isolated_copy(stage)
        assert not_meant(before, values(alone), []) == [], seed
        assert instances(alone) >= instances(stage), seed
        copy = scratch_copy(alone)
        edits = edit(copy, random.Random(seed))
        assert not_meant(before, values(copy), edits) == [], seed
    assert STAGES // 20 < refused < STAGES // 5
