"""Folders of shared storage: how they are configured, and which paths below them a tenant may name."""

from __future__ import annotations

from pathlib import Path

import pytest

from primray.errors import SettingsError
from primray_service.problems import Problem
from primray_service.shared_roots import SharedRoots, roots_of


@pytest.fixture
def roots(tmp_path: Path) -> SharedRoots:
    for name in ("shots", "assets", "outside"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.usda").write_text("#usda 1.0\n")
    (tmp_path / "shots" / "notes.txt").write_text("")
    (tmp_path / "shots" / "leaves.usda").symlink_to(tmp_path / "outside" / "scene.usda")
    (tmp_path / "shots" / "inside.usda").symlink_to("scene.usda")
    return roots_of([f"shots={tmp_path / 'shots'}", f"assets={tmp_path / 'assets'}"], ["assets=studio,lab"])


def test_a_root_is_named_to_its_tenants_alone(roots: SharedRoots) -> None:
    assert roots.names("studio") == ["assets", "shots"]
    assert roots.names("other") == ["shots"]
    with pytest.raises(Problem, match="no shared root of this name"):
        roots.file("assets/scene.usda", "other")


@pytest.mark.parametrize("text", ["shared:shots/scene.usda", "shots/scene.usda", "shots/inside.usda"])
def test_a_file_has_one_name(text: str, roots: SharedRoots) -> None:
    assert roots.file(text, "other").name == "shared:shots/scene.usda"


def test_a_changed_file_is_another_scene(roots: SharedRoots) -> None:
    file = roots.file("shots/scene.usda", "other")
    before = file.scene_id
    assert before == roots.file("shots/scene.usda", "other").scene_id
    file.path.write_text("#usda 1.0\n(doc = 'changed')\n")
    assert file.scene_id != before


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("nothing/scene.usda", "no shared root"),
        ("shots", "write it NAME/path.usda"),
        ("shots/../outside/scene.usda", r"without \. and \.\."),
        ("shots//scene.usda", r"without \. and \.\."),
        ("shots/scene.usda\0.usda", r"without \. and \.\."),
        ("shots/notes.txt", "'notes.txt' is not a usd"),
        ("shots/leaves.usda", "outside the shared root"),
        ("shots/none.usda", "no such file"),
    ],
)
def test_paths_that_are_refused(text: str, why: str, roots: SharedRoots) -> None:
    with pytest.raises(Problem, match=why):
        roots.file(text, "studio")


@pytest.mark.parametrize(
    ("folders", "tenants", "why"),
    [
        (["shots"], [], "write NAME=/folder"),
        (["shots=relative"], [], "write NAME=/folder"),
        (["a b=/tmp"], [], "write NAME=/folder"),
        (["shots=/"], [], "not an accessible folder"),
        (["shots=/no/such/folder"], [], "not an accessible folder"),
        (["shots=/tmp", "shots=/usr"], [], "two shared roots"),
        (["shots=/tmp"], ["assets=studio"], "unknown shared root 'assets'"),
        (["shots=/tmp"], ["shots"], "write NAME=tenant,tenant"),
    ],
)
def test_configurations_that_are_refused(folders: list[str], tenants: list[str], why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        roots_of(folders, tenants)
