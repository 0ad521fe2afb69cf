"""A stand-in for tev: a TCP server that takes its packets apart, and keeps the pictures that they make."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

CREATE, UPDATE = 4, 6


@dataclass
class Fields:
    """What is left of a packet."""

    data: bytes

    def numbers(self, form: str) -> tuple[int, ...]:
        size = struct.calcsize("<" + form)
        found, self.data = struct.unpack("<" + form, self.data[:size]), self.data[size:]
        return found

    def text(self) -> str:
        text, zero, self.data = self.data.partition(b"\0")
        assert zero
        return text.decode()

    def texts(self, count: int) -> list[str]:
        return [self.text() for _ in range(count)]


@dataclass
class FakeTev:
    """`planes`: by picture's name and channel's, (H, W); `created` and `updates`: packets, by name."""

    port: int
    planes: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    created: list[str] = field(default_factory=list)
    updates: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    last: tuple[str, int] = ("", 0)  # whose connection ends it
    sums: list[float] = field(default_factory=list)  # of R, after each update

    def picture(self, name: str, channels: tuple[str, ...]) -> np.ndarray:
        return np.stack([self.planes[name][channel] for channel in channels], axis=2)

    def take(self, packet: bytes) -> None:
        fields = Fields(packet)
        length, kind, grabs = fields.numbers("IBB")
        assert length == len(packet)
        {CREATE: self._create, UPDATE: self._update}[kind](fields, bool(grabs))

    def _create(self, fields: Fields, grabs: bool) -> None:
        name = fields.text()
        width, height, count = fields.numbers("iii")
        self.planes[name] = {channel: np.zeros((height, width), np.float32) for channel in fields.texts(count)}
        assert not fields.data
        assert grabs
        self.created.append(name)

    def _update(self, fields: Fields, grabs: bool) -> None:
        name = fields.text()
        [count] = fields.numbers("i")
        channels = fields.texts(count)
        x, y, width, height = fields.numbers("iiii")
        offsets, strides = fields.numbers(f"{count}q"), fields.numbers(f"{count}q")
        pixels = np.frombuffer(fields.data, "<f4")
        last = width * height - 1
        assert len(pixels) == max(offset + last * stride + 1 for offset, stride in zip(offsets, strides, strict=True))
        for channel, offset, stride in zip(channels, offsets, strides, strict=True):
            plane = self.planes[name][channel][y : y + height, x : x + width]
            plane[...] = pixels[offset::stride][: width * height].reshape(height, width)  # fails where it goes over the edge
        assert not grabs
        self.updates.append(name)
        self.sums.append(float(self.planes[name]["R"].sum()))


def _serve(tev: FakeTev, connection: socket.socket) -> None:
    with connection, connection.makefile("rb") as stream:
        while head := stream.read(4):
            try:
                tev.take(head + stream.read(struct.unpack("<I", head)[0] - 4))
            except Exception as error:
                tev.faults.append(repr(error))


def _accept(tev: FakeTev, listener: socket.socket, serving: list[threading.Thread]) -> None:
    """Until the last one comes: all before have been accepted by then."""
    while True:
        connection, address = listener.accept()
        if address == tev.last:
            connection.close()
            return
        serving.append(threading.Thread(target=_serve, args=(tev, connection), daemon=True))
        serving[-1].start()


@contextmanager
def fake_tev() -> Iterator[FakeTev]:
    """One that listens; after the block, all that was sent has been taken. AssertionError for packets that are none."""
    listener = socket.create_server(("127.0.0.1", 0))
    tev = FakeTev(listener.getsockname()[1])
    serving: list[threading.Thread] = []
    accepting = threading.Thread(target=_accept, args=(tev, listener, serving), daemon=True)
    accepting.start()
    try:
        yield tev
    finally:
        with socket.socket() as last:
            last.bind(("127.0.0.1", 0))
            tev.last = last.getsockname()
            last.connect(listener.getsockname())
            accepting.join(10)
        listener.close()
        for thread in serving:
            thread.join(10)
    assert not tev.faults, tev.faults
