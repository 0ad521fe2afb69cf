"""Pausing, rendering a frame again, and the administrator's page, in a real browser over a real server."""

from __future__ import annotations

import os
from pathlib import Path

from tests.service.api_calls import ENDLESS, QUICK, finished, submit, upload, wait_until
from tests.service.conftest import make_key
from tests.service.page.conftest import wait_for_state


def log_in(page, key):
    page.get_by_label("API key", exact=True).fill(key)
    page.keyboard.press("Enter")


def picture_of(page, name, tmp_path):
    page.screenshot(path=Path(os.environ.get("PRIMRAY_KEEP", tmp_path)) / f"{name}.png", full_page=True)


def test_an_administrator_sees_and_changes_the_jobs_of_all_tenants(open_page, start_server, tmp_path):
    server = start_server(require_keys=True, slots=1)
    keys = {
        name: make_key(f"sqlite:///{server.data}/primray.sqlite", name, *scopes)
        for name, scopes in (("lighting", ("submit", "read")), ("layout", ("submit", "read")), ("operator", ("admin",)))
    }
    clients = {name: server.client(key) for name, key in keys.items()}
    jobs = {
        name: submit(clients[name], upload(clients[name]), ENDLESS, name=f"{name} shot")["id"]
        for name in ("lighting", "layout")
    }
    done = submit(clients["lighting"], upload(clients["lighting"]), QUICK, name="done", priority=99)["id"]
    finished(clients["lighting"], done)
    watched = open_page("#/admin", url=server.url)
    page, watched.expected = watched.page, {401, 403}
    log_in(page, keys["lighting"])
    page.get_by_text("This requires a key with the scope").wait_for()  # a tenant's key sees nothing, and no link
    assert not page.get_by_role("link", name="Admin").is_visible()
    page.get_by_role("button", name="Log out").click()
    log_in(page, keys["operator"])
    page.get_by_role("link", name="Admin").wait_for()
    row = page.locator("tr", has_text="lighting shot").first
    row.wait_for()
    assert page.locator("tr", has_text="layout shot").first.is_visible()
    watched.expected = set()
    running = clients["operator"].get("/v1/admin/workers").json()["running"][0]["tenant"]
    waiting = "layout" if running == "lighting" else "lighting"
    page.get_by_role("region", name="Workers").get_by_text(f"{running} shot").wait_for()
    picture_of(page, "admin", tmp_path)
    row = page.get_by_role("region", name="Jobs of all tenants").locator("tr", has_text=f"{waiting} shot")
    row.get_by_label("Priority of").fill("80")
    page.keyboard.press("Enter")
    of = lambda name: clients[name].get(f"/v1/jobs/{jobs[name]}").json()  # noqa: E731
    wait_until(lambda: of(waiting)["priority"] == 80, 30)
    page.get_by_role("button", name=f"Pause {running} shot").click()
    wait_until(lambda: of(running)["state"] == "paused", 60)
    page.get_by_role("button", name=f"Resume {running} shot").wait_for()
    page.get_by_role("button", name=f"Cancel {waiting} shot").click()
    wait_until(lambda: of(waiting)["state"] == "canceled", 60)
    page.get_by_role("button", name="Quotas of layout").click()
    page.get_by_label("Jobs that run at a time").fill("3")
    picture_of(page, "quotas", tmp_path)
    page.get_by_role("button", name="Set", exact=True).click()
    page.get_by_text("quotas set").wait_for()
    assert clients["operator"].get("/v1/admin/tenants/layout").json()["quotas_set"] == {"running_jobs": 3}
    page.get_by_label("Tenant", exact=True).fill("layout")
    page.keyboard.press("Enter")
    page.locator("tr", has_text="lighting shot").first.wait_for(state="detached")
    assert server.failures() == []


def test_a_job_is_paused_and_resumed(open_page, site, tmp_path):
    with site.client() as client:
        job = submit(client, upload(client), {**ENDLESS, "stop": {"max_seconds": 900}})["id"]
        page = open_page(f"#/jobs/{job}").page
        wait_for_state(page, "running")
        page.get_by_role("button", name="Pause").click()
        wait_for_state(page, "paused")
        picture_of(page, "paused", tmp_path)
        assert client.get(f"/v1/jobs/{job}").json()["state"] == "paused"
        page.get_by_role("button", name="Resume").click()
        wait_for_state(page, "running")
        page.get_by_role("button", name="Pause").click()
        wait_for_state(page, "paused")
        page.get_by_role("button", name="Cancel").click()
        wait_for_state(page, "canceled")


def test_a_frame_is_rendered_again(open_page, site, tmp_path):
    with site.client() as client:
        job = submit(client, upload(client), {**QUICK, "frames": "1:3"})
        finished(client, job["id"])
        page = open_page(f"#/jobs/{job['id']}").page
        wait_for_state(page, "succeeded")
        assert not page.get_by_role("button", name="Render frame").is_visible()
        page.get_by_role("button", name="Frame 2:").click()
        picture_of(page, "retry", tmp_path)
        page.get_by_role("button", name="Render frame 2 again").click()
        attempts = lambda: [f["attempt"] for f in client.get(f"/v1/jobs/{job['id']}/frames").json()["items"]]  # noqa: E731
        wait_until(lambda: attempts() == [1, 2, 1], 30)
        assert finished(client, job["id"])["state"] == "succeeded"
        wait_for_state(page, "succeeded")
