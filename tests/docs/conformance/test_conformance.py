"""docs/conformance.md is what the tests' marks say, and a mark that says something else fails."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from .claims import CLAIMS, ROOT, Proof
from .page import NO_TEST, PAGE, missing, mistakes, page, state_of
from .rows import rows


@pytest.fixture(scope="module")
def claims(request: pytest.FixtureRequest) -> list[Proof]:
    """What all tests claim: known where this run has collected them all, else by collecting those that claim anything."""
    if CLAIMS in request.config.stash:
        return request.config.stash[CLAIMS]
    command = [sys.executable, "-m", "tests.docs.conformance.page", "--claims"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return [Proof(**claim) for claim in json.loads(result.stdout)]


def test_the_page_is_fresh(claims):
    assert PAGE.read_text(encoding="utf-8") == page(claims), "docs/conformance.md is stale; run `make docs`"


def test_every_row_has_a_test(claims):
    assert missing(claims) == []


@pytest.mark.parametrize(
    "name",
    [
        "Sphere.radius",
        "Gprim.primvars:displayColor",
        "LightAPI.inputs:intensity",
        "ShapingAPI.inputs:shaping:ies:file",
        "DomeLight_1.poleAxis",
        "RenderSettingsBase.dataWindowNDC",
        "Camera.exposure:fStop",
        "CollectionAPI.includes",
        "UsdPreviewSurface.inputs:ior",
        "UsdPrimvarReader_float2.inputs:varname",
        "UsdUVTexture.outputs:rgb",
        "MaterialBindingAPI.material:binding",
    ],
)
def test_the_schemas_give_the_rows(name):
    assert name in rows()


def test_what_is_about_nodes_definitions_is_no_row():
    assert not [name for name in rows() if name.startswith("UsdUVTexture.info:")]
    assert not [name for name in rows() if name.startswith("UsdPrimvarReader.")]  # abstract


def test_a_mark_that_names_no_row_or_state_is_refused():
    unknown = Proof("SphereLight.radius", "honoured", "tests/test_a.py", "test_it")
    misstated = Proof("SphereLight.inputs:radius", "perfect", "tests/test_a.py", "test_it")
    assert len(mistakes([unknown, misstated], rows())) == 2
    with pytest.raises(ValueError, match=r"test_it: SphereLight.radius is no row"):
        page([unknown])


def test_a_row_has_the_state_of_the_test_that_claims_least():
    def proof(state):
        return Proof("Sphere.radius", state, "tests/test_a.py", "test_it")

    assert state_of([]) == NO_TEST
    assert state_of([proof("honoured")]) == "honoured"
    assert state_of([proof("honoured"), proof("approximated")]) == "approximated"
    assert state_of([proof("diagnosed"), proof("honoured")]) == "diagnosed"


def test_the_page_tells_what_proves_a_row():
    text = page([Proof("Sphere.radius", "honoured", "tests/unit/test_a.py", "test_it")])
    assert "| `radius` | honoured | [test_it](../tests/unit/test_a.py) |" in text
    assert "Sphere.radius" not in missing([Proof("Sphere.radius", "honoured", "tests/unit/test_a.py", "test_it")])
    assert "Sphere.radius" in missing([])
