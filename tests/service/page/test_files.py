"""The page's files: what they are served with, and what must not be in them."""

from __future__ import annotations

import gzip
import hashlib
import posixpath
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "service/primray_service/page"
LIVE = ROOT / "renderer/primray/live/page"  # served below live/
# The folders of its modules: none imports from one that is not before it, those of one number not from each other.
ORDER = {
    "base": 0,
    "live": 0,
    "admin": 1,
    "docs": 1,
    "exr": 1,
    "layers": 1,
    "job": 2,
    "picture": 2,
    "scene": 2,
    "views": 3,
    "": 4,
}
OWN = sorted(path for folder in (PAGE, LIVE) for path in folder.rglob("*") if path.is_file() and "vendor" not in path.parts)
# What nothing is loaded from: a namespace, and the service's own address as examples have it.
ADDRESSES = ('xmlns="http://www.w3.org/2000/svg"', '"http://127.0.0.1:8700"')
# Of the files in uplot-1.6.32.tgz.
UPLOT = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    "LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}


def test_the_page_is_served(site):
    with site.client() as client:
        answer = client.get("/")
        assert answer.status_code == 200
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        policy = answer.headers["content-security-policy"]
        assert policy.startswith("default-src 'self'; img-src 'self' blob:;")
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert client.head("/").status_code == 200


@pytest.mark.parametrize(
    ("path", "media_type"),
    [
        ("main.js", "text/javascript; charset=utf-8"),
        ("views/job_view.js", "text/javascript; charset=utf-8"),
        ("live/light_rows.js", "text/javascript; charset=utf-8"),
        ("style/base.css", "text/css; charset=utf-8"),
        ("favicon.svg", "image/svg+xml"),
        ("examples/forest.jpg", "image/jpeg"),
        ("examples/forest.usda", "model/vnd.usda"),
        ("vendor/uplot/LICENSE", "text/plain; charset=utf-8"),
    ],
)
def test_each_file_has_its_type_and_is_asked_for_again(site, path, media_type):
    with site.client() as client:
        answer = client.get(f"/page/{path}", headers={"accept-encoding": "identity"})
        assert answer.content == file_of(path).read_bytes()
        assert answer.headers["content-type"] == media_type
        assert answer.headers["cache-control"] == "no-cache"
        again = client.get(f"/page/{path}", headers={"accept-encoding": "identity", "if-none-match": answer.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")


def test_packed_files_are_the_same_under_another_tag(site):
    with site.client() as client:
        plain = client.get("/page/main.js", headers={"accept-encoding": "identity"})
        with client.stream("GET", "/page/main.js", headers={"accept-encoding": "gzip"}) as packed:
            body = b"".join(packed.iter_raw())
        assert packed.headers["content-encoding"] == "gzip"
        assert gzip.decompress(body) == plain.content
        assert packed.headers["etag"] != plain.headers["etag"]
        assert len(body) < len(plain.content)
        refused = client.get("/page/main.js", headers={"accept-encoding": "gzip;q=0"})
        assert "content-encoding" not in refused.headers


@pytest.mark.parametrize(
    "path", ["nothing.js", "views/nothing.js", "../app.py", "%2e%2e/app.py", "..%2fapp.py", "vendor", "views", ""]
)
def test_there_is_nothing_else(site, path):
    with site.client() as client:
        answer = client.get(f"/page/{path}")
        assert answer.status_code == 404
        assert answer.json()["type"] == "/problems/not-found"


def test_nothing_is_inline_and_nothing_comes_from_elsewhere():
    html = (PAGE / "index.html").read_text()
    assert not re.search(r"<style|\sstyle=|\son\w+=", html)
    assert all("src=" in tag for tag in re.findall(r"<script[^>]*>", html))
    for path in (path for path in OWN if path.suffix != ".jpg"):
        text = path.read_text(encoding="utf-8")
        for allowed in ADDRESSES:
            text = text.replace(allowed, "")
        assert "://" not in text, path.name


def test_data_never_becomes_markup():
    for path in OWN:
        if path.suffix == ".js":
            code = re.sub(r"^\s*//.*$", "", path.read_text(), flags=re.MULTILINE)
            assert not re.search(r"innerHTML|outerHTML|insertAdjacent|document\.write|DOMParser|\beval\b|new Function", code), (
                path.name
            )


def test_imports_go_one_way_and_lead_to_files():
    for path in OWN:
        if path.suffix == ".js":
            here = folder_of(path)
            for name in re.findall(r'from "([^"]*)"', path.read_text()):
                assert name.startswith(("./", "../")), (path.name, name)
                address = posixpath.normpath(posixpath.join(here, name))
                assert file_of(address).is_file(), (path.name, name)
                there = posixpath.dirname(address)
                assert here == there or ORDER[there] < ORDER[here], f"{path.name} imports {name}"


def folder_of(path: Path) -> str:
    return "live" if path.parent == LIVE else path.parent.relative_to(PAGE).as_posix().removeprefix(".")


def file_of(address: str) -> Path:
    """Return the file that is served at an address below /page/."""
    return LIVE / address.removeprefix("live/") if address.startswith("live/") else PAGE / address


def test_files_are_short_and_say_what_they_are():
    for path in OWN:
        if path.suffix in (".js", ".css"):
            text = path.read_text()
            assert text.count("\n") <= 350, path.name
            assert text.startswith(("// ", "/* ")), path.name


@pytest.mark.parametrize("name", UPLOT)
def test_uplot_is_what_was_published(name):
    assert hashlib.sha256((PAGE / "vendor/uplot" / name).read_bytes()).hexdigest() == UPLOT[name]
