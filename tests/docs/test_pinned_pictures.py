"""The page about pinned pictures is so: its commands run one after the other, and so does its Python."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from primray.cli import run

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/pinned-pictures.md").read_text(encoding="utf-8")
SMALL = ["--resolution", "32", "16"]
NEED_KEYS = {"--sign", "--key"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copy(ROOT / "scenes/features/camera-lens/scene.usda", tmp_path / "shot.usda")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def commands() -> list[list[str]]:
    return [shlex.split(line, comments=True) for line in re.findall(r"^    primray (.*)$", PAGE, re.MULTILINE)]


def small(command: list[str]) -> list[str]:
    return [*command[:2], *SMALL, *command[2:]] if command[0] == "pin" else command


def test_its_commands_run(folder: Path) -> None:
    plain = [command for command in commands() if not NEED_KEYS & set(command)]
    assert [command[0] for command in plain] == ["pin", *5 * ["verify"]]
    for command in plain:
        if "farm.exr" in command:
            shutil.copy("shot.exr", "farm.exr")
        assert run(small(command)) == 0, command


def test_its_commands_about_attestations_run(folder: Path) -> None:
    pytest.importorskip("securesystemslib", reason="no securesystemslib")
    ed25519 = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ed25519", reason="no cryptography")
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, PublicFormat

    key = ed25519.Ed25519PrivateKey.generate()
    Path("key.pem").write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    Path("key.pub").write_bytes(key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    signing = [command for command in commands() if NEED_KEYS & set(command)]
    assert len(signing) == 2
    for command in signing:
        assert run(small(command)) == 0, command
    assert Path("shot.intoto.jsonl").exists()


def test_its_python_runs(folder: Path) -> None:
    found = re.search(r"In Python:\n\n((?:    .*\n)+)", PAGE)
    assert found
    text = "import primray\n" + re.sub("^    ", "", found[1], flags=re.MULTILINE)
    exec(compile(text.replace("spp=64", "spp=2, resolution=(32, 16)"), "pinned-pictures.md", "exec"), {})
