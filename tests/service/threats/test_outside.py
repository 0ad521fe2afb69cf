"""Scenes that name files outside of what was uploaded: by every kind of path, through every kind of opinion."""

from __future__ import annotations

import json
import os
import random
import re
import statistics
from typing import Any

import pytest
from tests.service.threats.fates import ROOM, Canary, Fate, fate, package, usda, usdz

# Where an asset path can stand; %s is the path between its @.
MATERIAL = """
def Material "M" { token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" { uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>; token outputs:surface }
    def Shader "T" { uniform token info:id = "UsdUVTexture"; asset inputs:file = @%s@; float3 outputs:rgb } }
"""
PLACES = {
    "sublayer": lambda p: usda(ROOM, f"subLayers = [@{p}@]"),
    "reference": lambda p: usda(ROOM + f'def "R" (references = @{p}@</X>) {{}}'),
    "payload": lambda p: usda(ROOM + f'def "R" (payload = @{p}@</X>) {{}}'),
    "reference of an inactive prim": lambda p: usda(ROOM + f'def "R" (active = false; references = @{p}@</X>) {{}}'),
    "variant that is not chosen": lambda p: usda(
        ROOM + 'def "R" (variants = { string v = "a" }; prepend variantSets = "v") { variantSet "v" = { '
        f'"a" {{}} "b" (references = @{p}@</X>) {{}} }} }}'
    ),
    "value clips": lambda p: usda(
        ROOM + f'def "R" (clips = {{ dictionary default = {{ asset[] assetPaths = [@{p}@]; string primPath = "/X"; '
        "double2[] active = [(0, 0)]; double2[] times = [(0, 0)] } }) {}"
    ),
    "manifest of clips": lambda p: usda(
        ROOM + f'def "R" (clips = {{ dictionary default = {{ asset manifestAssetPath = @{p}@; string primPath = "/X"; '
        "asset[] assetPaths = [] } }) {}"
    ),
    "texture": lambda p: usda(ROOM + MATERIAL % p),
    "dome light": lambda p: usda(ROOM + f'def DomeLight "D" {{ asset inputs:texture:file = @{p}@ }}'),
    "light profile": lambda p: usda(ROOM + f'def SphereLight "L" {{ asset inputs:shaping:ies:file = @{p}@ }}'),
    "time samples": lambda p: usda(ROOM + f'def "R" {{ asset a.timeSamples = {{ 0: @ok.png@, 1: @{p}@ }} }}'),
    "array": lambda p: usda(ROOM + f'def "R" {{ asset[] a = [@ok.png@, @{p}@] }}'),
    "metadata of a prim": lambda p: usda(ROOM + f'def "R" (customData = {{ asset a = @{p}@ }}) {{}}'),
    "metadata of the layer": lambda p: usda(ROOM, f"customLayerData = {{ asset a = @{p}@ }}"),
}
CANARY_OF = {"sublayer": "secret.usda", "light profile": "secret.ies", "texture": "secret.png", "dome light": "secret.png"}


@pytest.mark.parametrize("place", PLACES)
def test_a_path_outside_fails_the_job_with_layer_and_path(place: str, client: Any, canary: Canary) -> None:
    path = canary.path(CANARY_OF.get(place, "secret.usda"))
    found = fate(client, PLACES[place](path))
    assert (found.end, found.slug) in (("failed", "asset-path-outside-job"), ("rejected", "asset-path-outside-job"))
    assert found.problem["asset_path"] == path
    assert found.problem["layer"]
    canary.never_sang(found)


FORMS = {
    "absolute": lambda c: c.path("secret.usda"),
    "dots": lambda c: f"../../../{c.folder.name}/secret.usda",
    "dots after a folder": lambda c: f"./a/../../../../{c.folder.name}/secret.usda",
    "file URL": lambda c: f"file:{c.path('secret.usda')}",
    "file URL with a host": lambda c: f"file://localhost{c.path('secret.usda')}",
    "http": lambda c: "http://169.254.169.254/latest/meta-data.usda",
    "https": lambda c: "https://example.com/a.usda",
    "into a package outside": lambda c: f"{c.path('x.usdz')}[secret.usda]",
    "out of a package": lambda c: "in.usdz[../../secret.usda]",
    "backslashes": lambda c: "..\\..\\secret.usda",
    "proc": lambda c: "/proc/self/environ",
    "device": lambda c: "/dev/zero",
    "home": lambda c: "/root/.ssh/id_rsa",
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_path_outside(form: str, client: Any, canary: Canary) -> None:
    path = FORMS[form](canary)
    files: dict[str, str | bytes] = {
        "root.usda": usda(ROOM + f'def "R" (references = @{path}@</X>) {{}}'),
        "in.usdz": usdz({"a.usda": usda()}),
    }
    found = fate(client, package(files), entry="root.usda")
    assert found.end in ("failed", "rejected")
    assert found.slug in ("asset-path-outside-job", "package-unsafe"), found.problem
    assert path.partition("[")[0] in str(found.problem["asset_path"])
    canary.never_sang(found)


def test_udim_tiles_outside(client: Any, canary: Canary) -> None:
    found = fate(client, usda(ROOM + MATERIAL % canary.path("secret.<UDIM>.png")))
    assert found.slug == "asset-path-outside-job"
    canary.never_sang(found)


def test_a_search_path_of_the_servers_environment_is_not_used(client: Any, canary: Canary) -> None:
    found = fate(client, usda("", "subLayers = [@secret.usda@]"))
    assert found.end in ("failed", "rejected")
    assert found.slug == "asset-missing", found.problem
    canary.never_sang(found)
    beside = fate(client, usda(ROOM, "subLayers = [@secret.usda@]"))
    assert (beside.end, "composition-error" in beside.warnings) == ("succeeded", True)
    canary.never_sang(beside)


# References in b.usda lead outside only once root.usda's variable replaces its own: no look at one layer can see it.
def composed(canary_path: str, beside: str = "") -> bytes:
    variable = f'expressionVariables = {{ string X = "{canary_path}" }}'
    return package(
        {
            "root.usda": usda(beside + 'def "R" (references = @b.usda@</B>) {}', variable),
            "b.usda": usda(
                'def "B" { def "Q" (references = @`"${X}.usda"`@</X>) {} }', 'expressionVariables = { string X = "./ok" }'
            ),
            "ok.usda": usda('def Sphere "X" {}'),
        }
    )


def told(found: Fate, path: str, name: str) -> str:
    """What a client can read, but for what two files' names and two jobs make different."""
    text = json.dumps([found.end, found.problem, found.job.get("warnings"), found.scene["warnings"]], sort_keys=True)
    return re.sub(rf"request_id[^,}}]*|\b{name}\b", "", text.replace(path, "PATH"))


@pytest.mark.parametrize("beside", ["", ROOM], ids=["alone", "beside others"])
def test_what_expressions_compose_to_outside_is_as_good_as_missing(beside: str, client: Any, canary: Canary) -> None:
    """It fails where there is nothing else to see, as any missing layer does; in the same words whether the file exists."""
    outcomes = []
    for name in ("secret", "nothing"):
        path = canary.path(name)
        found = fate(client, composed(path, beside), entry="root.usda")
        if beside:
            assert (found.end, "composition-error" in found.warnings) == ("succeeded", True)
        else:
            assert (found.end in ("failed", "rejected"), found.slug) == (True, "asset-missing"), found.problem
        canary.never_sang(found)
        outcomes.append(told(found, path, name))
    assert outcomes[0] == outcomes[1]


@pytest.mark.long
def test_nobody_can_tell_by_time_whether_a_file_exists(client: Any, canary: Canary) -> None:
    """Thirty scenes each, in an order by chance, so that neither is always the one that finds a worker ready."""
    seconds: dict[str, list[float]] = {"secret": [], "nothing": []}
    order = ["secret", "nothing"] * 30
    random.Random(1).shuffle(order)
    for turn, name in enumerate(order):
        found = fate(client, composed(canary.path(name), f"# {turn}\n"), entry="root.usda")
        assert found.slug == "asset-missing"
        seconds[name].append(found.seconds)
    medians = {name: statistics.median(values) for name, values in seconds.items()}
    spread = statistics.stdev(seconds["secret"] + seconds["nothing"])
    print(medians, spread)
    # The difference of two medians of 30 has a deviation of 1.25 sqrt(2 / 30) = 0.32 of the spread.
    assert abs(medians["secret"] - medians["nothing"]) < max(0.02, spread)


def test_a_symbolic_link_cannot_be_uploaded_and_a_texture_inside_is_fine(client: Any) -> None:
    png = bytes.fromhex(
        "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63f8cfc0000003010100c9fe92ef"
        "0000000049454e44ae426082"
    )
    found = fate(client, package({"root.usda": usda(ROOM + MATERIAL % "tex/a.png"), "tex/a.png": png}))
    assert found.end == "succeeded", found.problem


def test_a_texture_that_is_missing_inside_is_a_warning_or_strict(client: Any) -> None:
    lit = ROOM + 'def DomeLight "D" { asset inputs:texture:file = @not_there.png@ }'
    found = fate(client, usda(lit))
    assert found.end == "succeeded", found.problem
    assert any("asset" in code or "texture" in code for code in found.warnings), found.warnings
    strict = fate(client, usda(lit), settings={"resolution": [16, 9], "stop": {"max_samples": 1}, "strict": True})
    assert (strict.end, strict.slug) == ("failed", "strict-warnings"), strict.problem


def test_what_looks_like_a_program_is_never_loaded(client: Any, server: Any, tmp_path: Any) -> None:
    marks = [str(server.data / f"ran-{kind}") for kind in ("py", "plug", "pth")]
    plug = '{"Plugins": [{"Type": "python", "Name": "evil", "Root": ".", "LibraryPath": "evil.so", "Info": {}}]}'
    files: dict[str, str | bytes] = {
        "root.usda": usda(ROOM),
        "plugInfo.json": plug,
        "evil/plugInfo.json": plug,
        "evil/__init__.py": f"open({marks[1]!r}, 'w')",
        "sitecustomize.py": f"open({marks[0]!r}, 'w')",
        "usercustomize.py": f"open({marks[0]!r}, 'w')",
        "numpy.py": f"open({marks[0]!r}, 'w')",
        "evil.pth": f"import os; open({marks[2]!r}, 'w')",
        "evil.so": b"\x7fELF" + bytes(100),
    }
    found = fate(client, package(files))
    assert found.end == "succeeded", found.problem
    assert not any(os.path.exists(mark) for mark in marks)
    assert found.warnings, "that they are ignored is told"


def test_a_products_name_is_no_path(client: Any, server: Any) -> None:
    render = (
        'def Scope "Render" { def RenderSettings "S" { rel camera = </cam>; rel products = [</Render/P>, </Render/Q>] }\n'
        'def RenderProduct "P" { token productName = "/etc/primray-was-here.exr"; rel orderedVars = </Render/V> }\n'
        'def RenderProduct "Q" { token productName = "../../../primray-was-here.exr"; rel orderedVars = </Render/V> }\n'
        'def RenderVar "V" { string sourceName = "Ci" } }'
    )
    found = fate(client, usda(ROOM + render, 'renderSettingsPrimPath = "/Render/S"'))
    assert found.end == "succeeded", found.problem
    assert not os.path.exists("/etc/primray-was-here.exr")
    outputs = client.get(f"/v1/jobs/{found.job['id']}/outputs").json()["items"]
    assert outputs
    assert all("/" not in output["name"] and ".." not in output["name"] for output in outputs)
    assert "product-name-rewritten" in found.warnings, found.warnings
    assert not list(server.data.parent.rglob("primray-was-here*"))
