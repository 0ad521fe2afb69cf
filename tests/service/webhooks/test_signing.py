"""Signatures against the scheme's own example and against an independent verifier."""

from __future__ import annotations

import json

import pytest

from primray_service.webhooks.signing import key_of, new_secret, signed_headers

from .verifying import verified

# The test vector of the scheme's Python library (libraries/python/tests in the repository of the specification).
SECRET = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
BODY = b'{"test": 2432232314}'


def test_the_vector_of_the_schemes_library() -> None:
    headers = signed_headers(SECRET, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, BODY)
    assert headers["webhook-signature"] == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="
    assert verified(headers, BODY, SECRET, now=1614265330) == json.loads(BODY)


def test_every_part_is_signed() -> None:
    secret = new_secret()
    headers = signed_headers(secret, "wh_1", 1000, BODY)
    assert verified(headers, BODY, secret, now=1010) == {"test": 2432232314}
    for broken in (
        {**headers, "webhook-id": "wh_2"},
        {**headers, "webhook-timestamp": "1001"},
        {**headers, "webhook-signature": "v1,AAAA"},
    ):
        with pytest.raises(ValueError, match="signature"):
            verified(broken, BODY, secret, now=1010)
    with pytest.raises(ValueError, match="signature"):
        verified(headers, BODY + b" ", secret, now=1010)
    with pytest.raises(ValueError, match="signature"):
        verified(headers, BODY, new_secret(), now=1010)
    with pytest.raises(ValueError, match="old"):
        verified(headers, BODY, secret, now=2000)


def test_secrets_that_are_made_differ_and_are_long_enough() -> None:
    made = {new_secret() for _ in range(100)}
    assert len(made) == 100
    assert all(len(key_of(secret)) == 32 for secret in made)


@pytest.mark.parametrize(
    ("secret", "says"),
    [
        ("MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "must start with whsec_"),
        ("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSwx", "not base64"),
        ("whsec_" + "A" * 28, "has 21"),
        ("whsec_" + "A" * 88, "has 66"),
    ],
)
def test_secrets_that_are_none(secret: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        key_of(secret)
