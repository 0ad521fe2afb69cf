"""MaterialX documents of a scene: they compose in the sandbox, and nothing that they name leads out of what was uploaded."""

from __future__ import annotations

import pytest
from tests.service.worker.checking import SPHERE, Checked, Files, check_many, usda

SCENE = usda('def "looks" (references = @looks.mtlx@</MaterialX/Materials>) {\n}\n' + SPHERE)
IMAGE = """<materialx version="1.39"{prefix}>{includes}
  <image name="i" type="color3"><input name="file" type="filename" value="{file}"/></image>
  <standard_surface name="S" type="surfaceshader"><input name="base_color" type="color3" nodename="i"/></standard_surface>
  <surfacematerial name="M" type="material"><input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
</materialx>"""
INCLUDE = '<xi:include href="{file}"/>'


def document(file: str, prefix: str = "", includes: str = "") -> str:
    return IMAGE.format(file=file, prefix=f' fileprefix="{prefix}"' if prefix else "", includes=includes)


OUT = {
    "texture": (document("../wood.png"), "../wood.png"),
    "absolute texture": (document("/etc/passwd"), "/etc/passwd"),
    "prefix": (document("wood.png", prefix="../maps/"), "../maps/wood.png"),
    "include": (document("wood.png", includes=INCLUDE.format(file="/etc/hostname")), "/etc/hostname"),
}
IN: dict[str, tuple[Files, list[str]]] = {
    "texture": ({"looks.mtlx": document("maps/wood.png"), "maps/wood.png": b"x"}, []),
    "texture that is not there": ({"looks.mtlx": document("maps/wood.png")}, ["asset-not-uploaded"]),
    "not readable": ({"looks.mtlx": "<materialx"}, ["materialx-document", "composition-error"]),
    "deep": ({"looks.mtlx": "<materialx>" + "<nodegraph>" * 100_000}, ["materialx-document", "composition-error"]),
}


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Checked]:
    scenes: dict[str, Files] = {
        f"out {name}".replace(" ", "-"): {"scene.usda": SCENE, "looks.mtlx": text} for name, (text, _) in OUT.items()
    }
    scenes |= {f"in {name}".replace(" ", "-"): {"scene.usda": SCENE, **files} for name, (files, _) in IN.items()}
    return check_many(tmp_path_factory.mktemp("slot"), scenes)


@pytest.mark.parametrize("name", OUT)
def test_what_leads_out_is_refused(name: str, checked: dict[str, Checked]) -> None:
    found = checked[f"out {name}".replace(" ", "-")]
    assert found.problem is not None, found.facts
    assert found.slug == "asset-path-outside-job"
    assert (found.problem["layer"], found.problem["asset_path"]) == ("looks.mtlx", OUT[name][1])


@pytest.mark.parametrize("name", IN)
def test_what_stays_inside_is_accepted(name: str, checked: dict[str, Checked]) -> None:
    found = checked[f"in {name}".replace(" ", "-")]
    assert found.problem is None
    assert found.codes() == IN[name][1]
