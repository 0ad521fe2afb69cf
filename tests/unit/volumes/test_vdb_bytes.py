"""Nothing is read beyond the file, and errors begin with the place."""

from __future__ import annotations

import struct

import pytest

from primray.volumes.vdb_bytes import VdbBytes, VdbError


def test_reads_in_order() -> None:
    source = VdbBytes(struct.pack("<IiqdB", 7, -7, -(1 << 40), 0.5, 9) + struct.pack("<I", 2) + b"ab" + b"rest", "here")
    assert (source.u32("a"), source.i32("b"), source.i64("c"), source.f64("d"), source.byte("e")) == (7, -7, -(1 << 40), 0.5, 9)
    assert (source.text("f"), source.take(4, "g"), source.at) == ("ab", b"rest", source.end)


@pytest.mark.parametrize(
    "read", [lambda s: s.take(5, "it"), lambda s: s.array("<f8", 1 << 60, "it"), lambda s: s.skip(-1, "it")]
)
def test_nothing_beyond_the_end(read) -> None:
    source = VdbBytes(b"12345678", "grid 'x', leaf 3", 2, 6)
    with pytest.raises(VdbError, match=r"grid 'x', leaf 3: it would have -?\d+ bytes, but only 4 are left"):
        read(source)
    assert source.at == 2


def test_texts_are_never_longer_than_the_file() -> None:
    with pytest.raises(VdbError, match="its name would have 4294967295 bytes"):
        VdbBytes(b"\xff\xff\xff\xff1234", "the file").text("its name")


def test_texts_that_are_no_utf8() -> None:
    assert VdbBytes(b"\2\0\0\0a\xff", "the file").text("its name") == "a�"
