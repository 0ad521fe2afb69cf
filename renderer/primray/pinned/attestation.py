"""Attestation of a pinned picture: an in-toto statement (v1) in a DSSE envelope, signed by a key.

Subjects are the EXR, its pixels, and the lock. Files and pixels are apart, since the EXR's bytes change with a compressor's
version. The envelope is the one that Sigstore wraps: whoever has an identity there signs the same payload. Nothing in it has a
time, so that a key signs the same picture with the same bytes. Counts are texts, as some readers keep numbers as doubles.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..content_hash import hash_of_file
from ..errors import SettingsError
from ..images.image import write_text
from ..images.output_path import check_folder
from ..installed_packages import version_of
from .difference import Difference, differences_between
from .lock import SUFFIX, Lock

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

STATEMENT = "https://in-toto.io/Statement/v1"
PREDICATE = "tag:primray,2026:pinned-picture/v1"
PAYLOAD = "application/vnd.in-toto+json"
ATTESTATION = ".intoto.jsonl"
PIXELS = "#pixels"


def statement_of(lock: Lock, place: Path) -> dict[str, Any]:
    """Return the statement about the picture of a lock, which is the file at `place`."""
    subject = [{"name": place.name, "digest": {"sha256": hash_of_file(place)}}]
    name = lock.stage if lock.file is None else lock.file
    if lock.file is not None:
        subject.append({"name": name, "digest": {"sha256": hash_of_file(place.absolute().parent / lock.file)}})
    subject.append({"name": f"{name}{PIXELS}", "digest": {"sha256": lock.picture.pixels_sha256}})
    picture = lock.picture
    return {
        "_type": STATEMENT,
        "subject": subject,
        "predicateType": PREDICATE,
        "predicate": {
            "stage": lock.stage,
            "settings": {name: str(value) if type(value) is int else value for name, value in lock.settings.items()},
            "resolvedDependencies": [{"name": name, "digest": {"sha256": digest}} for name, digest in lock.inputs.items()],
            "isa": lock.isa,
            "versions": dict(lock.versions),
            "environment": dict(lock.environment),
            "resolution": [str(number) for number in picture.resolution],
            "samples": str(picture.samples),
            "error": dict(lock.error),
        },
    }


def require_signing() -> None:
    """Raise SettingsError where the packages that sign and check signatures are not installed."""
    if version_of("securesystemslib") is None or version_of("cryptography") is None:
        sentence = "signatures need packages that are not installed: pip install primray[sign]"
        raise SettingsError(sentence, code="attestation-packages")


def attest(lock: str | os.PathLike[str], key: str | os.PathLike[str], output: str | os.PathLike[str] | None = None) -> Path:
    """Write the signed statement about a pinned picture beside its lock, as NAME.intoto.jsonl, and return its path.

    `key` is a PEM file with an Ed25519 private key, without a password. An attestation that is there gets a further signature,
    if it is of the same statement.
    """
    require_signing()
    from securesystemslib.dsse import Envelope
    from securesystemslib.signer import CryptoSigner  # type: ignore[attr-defined]

    place, private = Path(lock), _private_key(key)
    payload = json.dumps(statement_of(Lock.read(place)[0], place), sort_keys=True, ensure_ascii=False).encode()
    target = attestation_beside(place) if output is None else Path(output)
    check_folder(target)
    envelope = Envelope(payload, PAYLOAD, {})
    if target.exists():
        before = _envelope(target)
        envelope = before if before.payload == payload else envelope
    envelope.sign(CryptoSigner(private))
    write_text(target, json.dumps(envelope.to_dict()) + "\n")
    return target


def check_key(key: str | os.PathLike[str]) -> None:
    """Raise SettingsError, before rendering, where nothing can be signed with a key."""
    require_signing()
    _private_key(key)


def attestation_beside(lock: Path) -> Path:
    name = lock.name.removesuffix(SUFFIX) if lock.name.endswith(SUFFIX) else lock.stem
    return lock.with_name(f"{name}{ATTESTATION}")


def difference_of_attestation(
    lock: Lock, place: Path, key: str | os.PathLike[str], attestation: str | os.PathLike[str] | None = None
) -> Difference | None:
    """Return how a signed statement differs from a lock and its picture; None where the key signed what is there.

    `key` is a PEM file with an Ed25519 public key. SettingsError for files that are no key, or no attestation.
    """
    require_signing()
    from securesystemslib.exceptions import VerificationError
    from securesystemslib.signer import SSlibKey  # type: ignore[attr-defined]

    target = attestation_beside(place) if attestation is None else Path(attestation)
    public = SSlibKey.from_crypto(_public_key(key))
    if not target.exists():
        return Difference("attestation", str(target), "there", None)
    envelope = _envelope(target)
    try:
        envelope.verify([public], 1)
    except VerificationError:
        return Difference(
            "attestation", f"signature of {target}", f"by key {public.keyid[:16]}", "by another key, or of other contents"
        )
    signed = _statement(envelope, target)
    try:
        now = statement_of(lock, place)
    except OSError as error:
        return Difference("attestation", str(error.filename), "there", None)
    found = differences_between("attestation", _digests(signed), _digests(now))
    return next(found, None) or next(differences_between("attestation", signed, now), None)


def _digests(statement: Mapping[str, Any]) -> dict[str, Any]:
    return {str(each["name"]): each["digest"] for each in statement["subject"]}


def _envelope(path: Path) -> Any:
    from securesystemslib.dsse import Envelope

    try:
        return Envelope.from_dict(json.loads(path.read_text(encoding="utf-8")))
    except Exception as error:  # the library raises what its parser of each field raises
        raise SettingsError(f"it is no attestation: {error}", where=str(path), code="attestation-unreadable") from None


def _statement(envelope: Any, path: Path) -> dict[str, Any]:
    try:
        found = json.loads(envelope.payload)
        if envelope.payload_type != PAYLOAD or found["_type"] != STATEMENT or found["predicateType"] != PREDICATE:
            raise ValueError("it is a statement about something else")
        _digests(found)
    except (ValueError, KeyError, TypeError) as error:
        raise SettingsError(
            f"it is no attestation of a picture: {error}", where=str(path), code="attestation-unreadable"
        ) from None
    return dict(found)


def _private_key(path: str | os.PathLike[str]) -> Ed25519PrivateKey:
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        found = load_pem_private_key(Path(path).read_bytes(), None)
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise _no_key(path, "private", error) from None
    if not isinstance(found, Ed25519PrivateKey):
        raise _no_key(path, "private", "it is of another kind")
    return found


def _public_key(path: str | os.PathLike[str]) -> Ed25519PublicKey:
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    try:
        found = load_pem_public_key(Path(path).read_bytes())
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise _no_key(path, "public", error) from None
    if not isinstance(found, Ed25519PublicKey):
        raise _no_key(path, "public", "it is of another kind")
    return found


def _no_key(path: str | os.PathLike[str], kind: str, why: object) -> SettingsError:
    return SettingsError(f"it is no Ed25519 {kind} key in PEM: {why}", where=str(path), code="attestation-key")
