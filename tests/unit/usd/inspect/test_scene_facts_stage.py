"""What inspect says of a stage, against stages that have it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from primray.diagnostics import Diagnostics
from primray.usd import open_stage, stage_facts

TEXT = """#usda 1.0
(
    defaultPrim = "w"
    upAxis = "Z"
    metersPerUnit = 1
    startTimeCode = 1
    endTimeCode = 9
    timeCodesPerSecond = 30
)
def Xform "w" (
    variantSets = "look"
    variants = {
        string look = "b"
    }
)
{
    variantSet "look" = {
        "a" {
        }
        "b" {
        }
    }
    uniform token model:drawMode = "bounds"
    def Sphere "s"
    {
        double radius.timeSamples = { 2: 1, 7: 3 }
    }
    def Sphere "guide"
    {
        uniform token purpose = "guide"
    }
    def PointInstancer "i"
    {
        int[] protoIndices = [0, 0, 0]
        rel prototypes = </w/s>
    }
}
class "proto"
{
    def Cube "c"
    {
    }
}
def "n1" (
    instanceable = true
    references = </proto>
)
{
}
def "n2" (
    instanceable = true
    references = </proto>
)
{
}
def "later" (
    payload = @later.usda@
)
{
}
"""


def test_facts(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    path.write_text(TEXT)
    (tmp_path / "later.usda").write_text('#usda 1.0\n(\n defaultPrim = "x"\n)\ndef "x"\n{\n def Cone "c"\n {\n }\n}\n')
    facts = stage_facts(open_stage(path, Diagnostics()))
    json.dumps(facts)
    assert [Path(layer).name for layer in facts["layers"]] == ["a.usda", "later.usda"]
    assert (facts["up_axis"], facts["meters_per_unit"], facts["default_prim"]) == ("Z", 1, "/w")
    assert facts["time"] == {
        "start": 1.0,
        "end": 9.0,
        "time_codes_per_second": 30.0,
        "frames_per_second": pytest.approx(24.0),
        "sampled": [2.0, 7.0],
    }
    assert facts["variants"] == [{"prim": "/w", "set": "look", "selection": "b", "names": ["a", "b"]}]
    assert facts["payloads"] == {"loaded": ["/later"], "unloaded": []}
    assert {name: facts["prim_types"][name] for name in ("Sphere", "Cone", "PointInstancer")} == {
        "Sphere": 2,
        "Cone": 1,
        "PointInstancer": 1,
    }
    assert facts["purposes"]["guide"] == 1
    assert (facts["native_instances"], facts["native_prototypes"]) == (2, 1)
    assert facts["point_instancers"] == [{"path": "/w/i", "instances": 3, "prototypes": ["/w/s"]}]
    assert facts["draw_modes"] == [{"prim": "/w", "mode": "bounds"}]
