"""Where the server demands a key: the page asks for it, pictures and events come by the cookie, and logging out works."""

from __future__ import annotations

from tests.service.conftest import make_key
from tests.service.page.conftest import choose, render, wait_for_state


def test_a_key_is_asked_for_and_exchanged(open_page, start_server):
    server = start_server(require_keys=True)
    key = make_key(f"sqlite:///{server.data}/primray.sqlite", "studio", "submit", "read")
    watched = open_page("#/jobs", url=server.url)
    page = watched.page
    watched.expected = {401}
    field = page.get_by_label("API key", exact=True)
    field.wait_for()
    field.fill("wrong")
    page.keyboard.press("Enter")
    page.get_by_text("A valid API key is needed").first.wait_for()  # on the page, and soon in the dialog
    field.fill(key)
    page.keyboard.press("Enter")
    page.get_by_text("There are no jobs yet.").wait_for()
    watched.expected = set()
    cookie = page.context.cookies()[0]
    assert cookie["httpOnly"]
    assert cookie["sameSite"] == "Strict"
    assert key not in cookie["value"]
    assert page.evaluate("JSON.stringify([localStorage, sessionStorage])") == "[{},{}]"
    page.get_by_role("link", name="New render").click()
    choose(page)
    render(page, samples=4)
    page.wait_for_selector(".stage img")
    wait_for_state(page, "succeeded", 60)
    watched.expected = {401}
    page.get_by_role("button", name="Log out").click()
    page.get_by_label("API key", exact=True).wait_for()
