"""Assets that Ar resolves and cannot open are errors of ours, with USD's reason."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from primray.errors import AssetError
from primray.usd.stage.reads import read_asset


def packaged(folder: Path, compression: int) -> str:
    path = folder / "shot.usdz"
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("root.usda", "#usda 1.0\n")
        package.writestr("paint.png", b"paint", compression)
    return f"{path}[paint.png]"


def test_what_a_package_stores_is_read(tmp_path: Path) -> None:
    assert read_asset(packaged(tmp_path, zipfile.ZIP_STORED)) == b"paint"


def test_what_a_package_compresses_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="compressed files are not supported"):
        read_asset(packaged(tmp_path, zipfile.ZIP_DEFLATED))


def test_an_empty_file_has_no_bytes(tmp_path: Path) -> None:
    path = tmp_path / "empty.vdb"
    path.write_bytes(b"")
    assert read_asset(str(path)) == b""
