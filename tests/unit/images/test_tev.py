"""Pictures in tev: packets as tev's own Python client makes them, sent to what listens, and what becomes of faults."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from tests.tev_server import fake_tev

from primray.description import Frame, PixelWindow
from primray.errors import PrimrayError, SettingsError
from primray.images import tev
from primray.images.image import CHANNELS, ERROR_CHANNELS, Image
from primray.images.tev import TevPicture, create_packet, pixel_packets, tev_address

ALL = (*CHANNELS, *ERROR_CHANNELS)
VALUES = np.random.default_rng(0).random((5, 7, 7), np.float32)


def picture(frame: Frame | None = None) -> Image:
    return Image(VALUES[..., :4], errors=VALUES[..., 4:], frame=frame)


def test_packets_are_those_of_tevs_own_client() -> None:
    """tevclient 1.0.4: create_image("shöt", 5, 4, ALL) and update_image("s", [[[1, -0.5]]], ["R", "A"], 1, 2)."""
    made = (
        "3b00000004017368c3b6740005000000040000000700000052004700420041007374646572722e52007374646572722e47007374646572722e4200"
    )
    assert create_packet("shöt", (5, 4), ALL).hex() == made
    changed = (
        "480000000600730002000000520041000100000002000000010000000100000000000000000000000100000000000000020000000000000002000000"
        "000000000000803f000000bf"
    )
    assert [p.hex() for p in pixel_packets("s", ("R", "A"), np.array([[[1, -0.5]]], np.float32), (1, 2))] == [changed]


@pytest.mark.parametrize(
    ("text", "host", "port", "name"),
    [
        ("tev://localhost", "localhost", 14158, "primray"),
        ("tev://localhost/", "localhost", 14158, "primray"),
        ("TEV://127.0.0.1:7", "127.0.0.1", 7, "primray"),
        ("tev://[::1]:7/a%20b/shot.0001", "::1", 7, "a b/shot.0001"),
        ("tev://box.example/shot#1", "box.example", 14158, "shot#1"),
    ],
)
def test_addresses(text: str, host: str, port: int, name: str) -> None:
    assert tev_address(text) == tev.TevAddress(host, port, name)


@pytest.mark.parametrize(
    "text", ["tev://", "tev:///shot", "tev://h:port", "tev://h:70000", "tev://h:0", "tev://h/a?b", "tev://me@h", "tev://[::1"]
)
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(SettingsError, match="not an address of tev") as caught:
        tev_address(text)
    assert (caught.value.code, caught.value.where) == ("tev-address", text)


@pytest.mark.parametrize("band_bytes", [1, 2 * 7 * 7 * 4, 1 << 22])
def test_all_channels_arrive(band_bytes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tev, "BAND_BYTES", band_bytes)
    with fake_tev() as server:
        shown = TevPicture(f"tev://127.0.0.1:{server.port}/shot")
        shown.show(picture())
        shown.show(picture())
        shown.close()
    assert (server.picture("shot", ALL) == VALUES).all()
    assert server.created == ["shot"]
    assert len(server.updates) == 2 * {1: 5, 2 * 7 * 7 * 4: 3, 1 << 22: 1}[band_bytes]


def test_a_picture_without_errors_and_one_of_another_size() -> None:
    with fake_tev() as server:
        shown = TevPicture(f"tev://127.0.0.1:{server.port}")
        shown.show(picture())
        shown.show(Image(VALUES[:3, :, :4]))
        shown.close()
    assert server.created == ["primray", "primray"]
    assert list(server.planes["primray"]) == list(CHANNELS)
    assert (server.picture("primray", CHANNELS) == VALUES[:3, :, :4]).all()


@pytest.mark.parametrize(
    ("pixels", "size", "corner"),
    [
        (PixelWindow(2, 1, 7, 5), (12, 8), (2, 1)),  # a part
        (PixelWindow(-1, -2, 7, 5), (13, 10), (0, 0)),  # over the upper left corner
        (PixelWindow(10, 6, 7, 5), (17, 11), (10, 6)),  # over the lower right one
    ],
)
def test_pixels_lie_where_their_frame_says(pixels: PixelWindow, size: tuple[int, int], corner: tuple[int, int]) -> None:
    with fake_tev() as server:
        shown = TevPicture(f"tev://127.0.0.1:{server.port}/a")
        shown.show(picture(Frame((12, 8), pixels)))
        shown.close()
    whole = server.picture("a", ALL)
    x, y = corner
    assert whole.shape[:2] == (size[1], size[0])
    assert (whole[y : y + 5, x : x + 7] == VALUES).all()
    assert np.count_nonzero(whole) == np.count_nonzero(VALUES)


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    for output in (f"tev://127.0.0.1:{port}/a", "tev://no-such-host.invalid/a"):
        with pytest.raises(SettingsError, match=r"no tev is listening: .+; start tev") as caught:
            TevPicture(output)
        assert (caught.value.code, caught.value.where, caught.value.exit_code) == ("tev-unreachable", output, 2)


def test_one_that_takes_nothing_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tev, "SEND_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        output = f"tev://127.0.0.1:{listener.getsockname()[1]}"
        shown, [connection, _] = TevPicture(output), listener.accept()
        with connection, pytest.raises(PrimrayError, match="tev does not accept the picture: timed out") as caught:
            shown.show(Image(np.zeros((1000, 1000, 4), np.float32)))
        shown.close()
    assert (caught.value.code, caught.value.where) == ("write-failed", output)
