"""A first visit: the page says how it goes and has examples; the form offers outputs and tells times to errors."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.service.page.conftest import choose, until
from tests.service.page.scenes import SMALL, submit, upload

ROOT = Path(__file__).parents[3]
EXAMPLES = {"materials": "preview-surface", "interiors": "interiors", "forest": "point-instancer"}
TIMES = "[...document.querySelectorAll('.quality .time')].map((time) => time.textContent)"

PRODUCTS = """
def Scope "Render"
{
    def RenderSettings "s"
    {
        rel products = [</Render/a>, </Render/b>]
    }
    def RenderProduct "a"
    {
        rel orderedVars = [</Render/depth>]
    }
    def RenderProduct "b"
    {
    }
    def RenderVar "depth"
    {
        uniform string sourceName = "depth"
    }
}
"""


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_the_projects_scenes(name):
    example = ROOT / f"service/primray_service/page/examples/{name}.usda"
    assert example.read_bytes() == (ROOT / f"scenes/features/{EXAMPLES[name]}/scene.usda").read_bytes()
    assert example.with_suffix(".jpg").stat().st_size < 20_000


def test_an_example_fills_the_form_which_sends_its_outputs(open_page):
    page = open_page().page
    assert page.locator(".steps li").count() == 3
    until(page, "[...document.querySelectorAll('.example img')].every((image) => image.complete && image.naturalWidth === 400)")
    page.get_by_role("button", name="A forest").click()
    page.wait_for_selector("form.settings")
    assert not page.locator(".first").is_visible()
    assert page.get_by_label("Name", exact=True).input_value() == "forest.usda"
    page.get_by_text("Outputs and purposes").click()
    assert page.get_by_label("normal", exact=True).is_checked()
    page.get_by_label("albedo", exact=True).uncheck()
    page.get_by_label("crypto object").check()
    page.get_by_label("And by name").fill("primvar:st, labels:wikidata")
    page.get_by_label("standard errors").check()
    page.get_by_label("proxy").check()
    page.get_by_text("More", exact=True).click()
    page.get_by_label("Clamp indirect light at").fill("2.5")
    page.get_by_label("caustics", exact=True).uncheck()
    page.get_by_label("Width", exact=True).fill("32")
    page.get_by_label("Or after samples a pixel").fill("2")
    with page.expect_response(lambda answer: answer.url.endswith("/v1/jobs") and answer.request.method == "POST") as sent:
        page.get_by_role("button", name="Render", exact=True).click()
    settings = sent.value.request.post_data_json["settings"]
    assert settings["aovs"] == ["depth", "normal", "prim", "crypto_object", "primvar:st", "labels:wikidata"]
    assert settings["aov_errors"] is True
    assert settings["purposes"] == ["default", "render", "proxy"]
    assert settings["denoise"] is None
    assert (settings["clamp_indirect"], settings["caustics"]) == (2.5, False)
    assert sent.value.status == 202


def test_products_of_the_stage_are_offered(open_page):
    page = open_page().page
    choose(page, "products.usda", SMALL + PRODUCTS)
    page.get_by_text("Outputs and purposes").click()
    assert page.get_by_label("Which AOVs").input_value() == "ordered"
    assert not page.get_by_label("albedo", exact=True).is_visible()
    page.get_by_label("Product", exact=True).select_option("/Render/b")
    page.get_by_label("Width", exact=True).fill("32")
    page.get_by_label("Or after samples a pixel").fill("2")
    with page.expect_response(lambda answer: answer.url.endswith("/v1/jobs") and answer.request.method == "POST") as sent:
        page.get_by_role("button", name="Render", exact=True).click()
    settings = sent.value.request.post_data_json["settings"]
    assert settings["products"] == ["/Render/b"]
    assert settings["aovs"] is None
    assert sent.value.status == 202


def test_times_come_from_an_earlier_render_or_a_small_one(open_page, site):
    """They follow what is chosen; what was rendered for them is gone afterwards."""
    scene = SMALL + "# estimated"
    with site.client() as client:
        found = upload(client, scene, name="estimated.usda")
        submit(client, found, camera="/camera", stop={"max_samples": 64}, wait_s=60)
        page = open_page().page
        choose(page, "estimated.usda", scene)
        until(page, f"{TIMES}[0] !== ''")
        assert "earlier render" in page.locator(".estimate").inner_text()
        times = page.evaluate(TIMES)
        assert len(set(times[:3])) == 3
        assert times[3] == ""
        page.get_by_label("Own target error").fill("0.001")
        until(page, f"{TIMES}[3] === {TIMES}[1]")
        page.get_by_role("button", name="quarter").click()
        assert page.evaluate(TIMES) != times
        # Another camera sees something else.
        page.get_by_label("Camera", exact=True).select_option("/side")
        assert page.evaluate(TIMES) == [""] * 4
        ended = f"{TIMES}[0] !== '' || document.querySelector('.estimate').textContent.includes('no estimate')"
        # A busy machine may draw too little of the small picture, says so, and is asked again.
        for _ in range(20):
            page.get_by_role("button", name="Estimate the times").click()
            until(page, ended)
            if page.evaluate(TIMES)[0]:
                break
        assert page.evaluate(TIMES)[0]
        assert "small picture" in page.locator(".estimate").inner_text()
        page.wait_for_load_state("networkidle")
        assert client.get("/v1/jobs", params={"label": "estimate:"}).json()["items"] == []
