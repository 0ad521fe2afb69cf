"""The configuration of a server: what follows from the host, and values that are refused before it starts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from primray.errors import SettingsError
from primray_service.config import ServeConfig
from primray_service.shared_roots import SharedRoot, SharedRoots

HERE = Path("/srv/primray")


@pytest.mark.parametrize(
    ("host", "needs_keys"),
    [("127.0.0.1", False), ("127.9.9.9", False), ("::1", False), ("localhost", False), ("0.0.0.0", True), ("farm", True)],
)
def test_keys_are_needed_except_on_loopback(host: str, needs_keys: bool) -> None:
    assert ServeConfig(HERE, host=host).needs_keys is needs_keys
    assert ServeConfig(HERE, host=host, require_keys=True).needs_keys
    assert not ServeConfig(HERE, host=host, require_keys=False).needs_keys


def test_the_database_is_in_the_data_directory_unless_it_is_given() -> None:
    assert ServeConfig(HERE).database_url == "sqlite:////srv/primray/primray.sqlite"
    assert ServeConfig(HERE, database="postgresql+psycopg://db/primray").database_url == "postgresql+psycopg://db/primray"


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"executor": "slurm"}, "executor"),
        ({"objects": "s3://bucket/primray"}, "objects-database"),
        ({"shared_roots": SharedRoots((SharedRoot("shots", HERE),)), "executor": "ray"}, "shared-root"),
        ({"ray_labels": ("pool",)}, "ray-label"),
        ({"allowed_origins": ("*",)}, "allow-origin"),
        ({"allowed_origins": ("https://Example.com",)}, "allow-origin"),
        ({"allowed_origins": ("https://example.com/page",)}, "allow-origin"),
    ],
)
def test_values_that_are_refused(values: dict[str, Any], code: str) -> None:
    with pytest.raises(SettingsError) as caught:
        ServeConfig(HERE, **values)
    assert caught.value.code == code


def test_origins_and_labels_that_are_taken() -> None:
    ServeConfig(HERE, allowed_origins=("https://example.com", "http://[::1]:8080"), ray_labels=("pool=render",))
