"""Attestations are read by a library of others; one changed byte of what was signed is found."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import pytest

import primray
from primray.cli import run
from primray.content_hash import hash_of_file
from primray.errors import SettingsError
from primray.pinned.attestation import attest
from primray.pinned.verification import verify

from .shot import changed, write_shot

# A public key on a curve of WAP, which the library reads and does not support.
OF_WAP = "MD4wEAYHKoZIzj0CAQYFZysBBAkDKgAEJevrv6GS6r6QHpX+GPQv3FHFBS15nusCR7c7UhYMIRSqfx+O0mnY3w=="

dsse = pytest.importorskip("securesystemslib.dsse", reason="no securesystemslib")
ed25519 = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ed25519", reason="no cryptography")


def write_keys(folder: Path, name: str) -> tuple[Path, Path]:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, PublicFormat

    private = ed25519.Ed25519PrivateKey.generate()
    secret, public = folder / f"{name}.pem", folder / f"{name}.pub"
    secret.write_bytes(private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    public.write_bytes(private.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    return secret, public


@pytest.fixture
def signed(tmp_path: Path) -> tuple[Path, Path, Path]:
    """A lock whose picture is attested, and the key's two files."""
    secret, public = write_keys(tmp_path, "mine")
    lock = primray.pin(write_shot(tmp_path), tmp_path / "a.exr", resolution=(32, 16), spp=2, seed=7, threads=2).file
    assert attest(lock, secret) == tmp_path / "a.intoto.jsonl"
    return lock, secret, public


def envelope_of(lock: Path) -> dict[str, Any]:
    return dict(json.loads((lock.parent / "a.intoto.jsonl").read_text()))


def test_a_librarys_reader_finds_the_statement(signed: tuple[Path, Path, Path]) -> None:
    from cryptography.hazmat.primitives.serialization import load_pem_public_key
    from securesystemslib.signer import SSlibKey  # type: ignore[attr-defined]

    lock, _, public = signed
    key: Any = load_pem_public_key(public.read_bytes())
    envelope = dsse.Envelope.from_dict(envelope_of(lock))
    assert len(envelope.verify([SSlibKey.from_crypto(key)], 1)) == 1
    # The signature is Ed25519's of DSSE's encoding, whatever library reads it.
    told = envelope_of(lock)
    payload, kind = base64.b64decode(told["payload"]), told["payloadType"].encode()
    key.verify(base64.b64decode(told["signatures"][0]["sig"]), b"DSSEv1 %d %b %d %b" % (len(kind), kind, len(payload), payload))
    statement = json.loads(payload)
    assert kind == b"application/vnd.in-toto+json"
    assert statement["_type"] == "https://in-toto.io/Statement/v1"
    found = {each["name"]: each["digest"]["sha256"] for each in statement["subject"]}
    sha256 = json.loads(lock.read_text())["picture"]["pixels_sha256"]
    assert found == {"a.lock.json": hash_of_file(lock), "a.exr": hash_of_file(lock.parent / "a.exr"), "a.exr#pixels": sha256}
    assert [each["name"] for each in statement["predicate"]["resolvedDependencies"]] == ["shot.usda", "paint.png"]
    assert statement["predicate"]["settings"]["seed"] == "7"


def test_a_key_signs_the_same_bytes_twice_and_another_adds_its_own(signed: tuple[Path, Path, Path], tmp_path: Path) -> None:
    lock, secret, public = signed
    before = (lock.parent / "a.intoto.jsonl").read_bytes()
    attest(lock, secret)
    assert (lock.parent / "a.intoto.jsonl").read_bytes() == before
    other, other_public = write_keys(tmp_path, "other")
    assert verify(lock, key=other_public, share=0).difference is not None
    attest(lock, other)
    assert len(envelope_of(lock)["signatures"]) == 2
    assert verify(lock, key=other_public, share=0).difference is None
    assert verify(lock, key=public, share=0).difference is None


@pytest.mark.parametrize("part", ["payload", "sig"])
def test_one_changed_bit_of_what_was_signed_is_found(signed: tuple[Path, Path, Path], part: str) -> None:
    lock, _, public = signed
    told = envelope_of(lock)
    holder = told if part == "payload" else told["signatures"][0]
    octets = bytearray(base64.b64decode(holder[part]))
    octets[40] ^= 1
    holder[part] = base64.b64encode(octets).decode()
    (lock.parent / "a.intoto.jsonl").write_text(json.dumps(told))
    found = verify(lock, key=public, share=0).difference
    assert found is not None
    assert (found.kind, found.now) == ("attestation", "by another key, or of other contents")


def test_a_lock_or_a_picture_that_was_not_signed_is_found(signed: tuple[Path, Path, Path]) -> None:
    """A forger who changes the lock with its seals, and the EXR, cannot sign them."""
    lock, _, public = signed
    text = lock.read_text()
    changed(lock, lambda found: found["picture"]["tiles"].__setitem__(0, "0" * 64))
    found = verify(lock, key=public, share=0).difference
    assert found is not None
    assert (found.kind, found.what) == ("attestation", "a.lock.json")
    lock.write_text(text)
    assert verify(lock, key=public).is_whole
    picture = lock.parent / "a.exr"
    picture.write_bytes(picture.read_bytes() + b"0")
    found = verify(lock, key=public, share=0).difference
    assert found is not None
    assert (found.kind, found.what) == ("attestation", "a.exr")
    (lock.parent / "a.intoto.jsonl").unlink()
    found = verify(lock, key=public, share=0).difference
    assert found is not None
    assert (found.kind, found.now) == ("attestation", None)


def test_files_that_are_no_keys_and_no_attestations_are_refused(signed: tuple[Path, Path, Path], tmp_path: Path) -> None:
    lock, secret, public = signed
    with pytest.raises(SettingsError, match="no Ed25519 private key"):
        attest(lock, public)
    with pytest.raises(SettingsError, match="no Ed25519 public key"):
        verify(lock, key=secret)
    with pytest.raises(SettingsError, match="no Ed25519 private key"):
        attest(lock, tmp_path / "none")
    (tmp_path / "odd.pem").write_text(f"-----BEGIN PUBLIC KEY-----\n{OF_WAP}\n-----END PUBLIC KEY-----\n")
    with pytest.raises(SettingsError, match="no Ed25519 public key"):
        verify(lock, key=tmp_path / "odd.pem")
    for text in ("{}", "no JSON", json.dumps({"payload": "", "payloadType": "", "signatures": [{}]})):
        (tmp_path / "bad.jsonl").write_text(text)
        with pytest.raises(SettingsError, match="it is no attestation"):
            verify(lock, key=public, attestation=tmp_path / "bad.jsonl")


def test_the_commands_sign_and_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_shot(tmp_path)
    write_keys(tmp_path, "key")
    assert run(["pin", "shot.usda", "-o", "a.exr", "-r", "32", "16", "-p", "2", "--sign", "key.pem"]) == 0
    assert capfd.readouterr().out.splitlines()[-1] == "a.intoto.jsonl: signed"
    assert run(["verify", "a.lock.json", "--key", "key.pub"]) == 0
    assert capfd.readouterr().out.splitlines()[-1] == "its attestation is signed by key.pub"
    _, other = write_keys(tmp_path, "other")
    assert run(["verify", "a.lock.json", "--key", str(other)]) == 1
    assert "attestation signature of a.intoto.jsonl: by key " in capfd.readouterr().out
    assert run(["pin", "shot.usda", "-o", "b.exr", "--sign", "key.pub"]) == 2
    assert not Path("b.exr").exists()
