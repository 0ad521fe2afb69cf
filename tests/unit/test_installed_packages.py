"""Versions and libraries of installed packages, as importlib.metadata has them."""

from __future__ import annotations

from importlib import metadata

import pytest

from primray.installed_packages import library_of, schema_folder, version_of


@pytest.mark.parametrize("package", ["numpy", "usd-core", "usd_core", "OpenImageIO", "primray"])
def test_versions_are_those_of_the_metadata(package: str) -> None:
    assert version_of(package) == metadata.version(package)


def test_what_is_not_installed_has_neither_version_nor_library() -> None:
    assert version_of("no-such-package") is None
    assert library_of("no-such-package", "lib") is None


def test_schemas_are_in_their_folder() -> None:
    assert list(schema_folder().rglob("plugInfo.json*"))
