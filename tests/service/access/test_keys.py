"""Keys as text: long enough, and mistakes in them are seen."""

from __future__ import annotations

import pytest

from primray_service.access import keys


def test_a_key_holds_256_bits_and_tells_mistakes() -> None:
    text = keys.make(bytes(range(32)))
    assert text == keys.make(bytes(range(32)))
    assert len({keys.make() for _ in range(100)}) == 100
    assert keys.is_whole(text)
    for wrong in (text[:-1], text + "a", text.replace("A", "B"), text.upper(), "", text.replace("primray_", "primray-")):
        assert not keys.is_whole(wrong)
    with pytest.raises(ValueError, match="32"):
        keys.make(b"short")
