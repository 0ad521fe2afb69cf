"""Keys as text: long enough, and mistakes in them are seen."""

from __future__ import annotations

import pytest

from primray_service import auth


def test_a_key_holds_256_bits_and_tells_mistakes() -> None:
    text = auth.make_key(bytes(range(32)))
    assert text == auth.make_key(bytes(range(32)))
    assert len({auth.make_key() for _ in range(100)}) == 100
    assert auth.is_whole_key(text)
    for wrong in (text[:-1], text + "a", text.replace("A", "B"), text.upper(), "", text.replace("primray_", "primray-")):
        assert not auth.is_whole_key(wrong)
    with pytest.raises(ValueError, match="32"):
        auth.make_key(b"short")
