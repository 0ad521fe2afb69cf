"""What scenes are called as files, and jobs that were given no name."""

from __future__ import annotations

import pytest

from primray_service.scenes.recognize import file_name, job_name


@pytest.mark.parametrize(
    ("sent_as", "kind", "name"),
    [
        ("shot.usda", "usda", "shot.usda"),
        ("shot.usd", "usdc", "shot.usd"),
        ("Mein Büro v2.usdz", "usdz", "Mein Büro v2.usdz"),
        ("a/b\\shot.usda", "usda", "shot.usda"),
        ("shot", "usdc", "shot.usdc"),
        ("shot.v2", "usdc", "shot.v2.usdc"),
        ("shot.usda", "usdc", "shot.usdc"),  # a crate that is called a text, which USD would not open
        ("shot.zip", "usdz", "shot.usdz"),
        ("", "usda", "scene.usda"),
        ("..", "usda", "scene.usda"),
        (".hidden.usda", "usda", "scene.usda"),
        ("checkpoint.prc", "usda", "checkpoint.prc.usda"),
        ("x[1].usda", "usda", "scene.usda"),
        ("@x@.usda", "usda", "scene.usda"),
        ("x" * 200 + ".usda", "usda", "scene.usda"),
        ("ü" * 100 + ".usda", "usda", "scene.usda"),
    ],
)
def test_files_keep_the_names_that_they_were_sent_by(sent_as: str, kind: str, name: str) -> None:
    assert file_name(sent_as, kind) == name


@pytest.mark.parametrize(
    ("given", "name"),
    [
        (("shot.usda", None, None, None), "shot"),
        (("shot.zip", "a/root.usda", "/World/cams/main", "1-10x2"), "root main 1-10x2"),
        (("", None, None, None), "scene"),
        (("x" * 300, None, "/cam", None), "x" * 255),
    ],
)
def test_jobs_are_named_after_what_tells_them_apart(given: tuple[str, str | None, str | None, str | None], name: str) -> None:
    assert job_name(*given) == name
