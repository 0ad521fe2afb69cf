"""Previews over HTTP: views, channels, exposure, formats, widths, ETags, and how quickly the server answers meanwhile."""

from __future__ import annotations

import io
import json
import os
import signal
import struct
import subprocess
import threading
import time
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from tests.service.api_calls import wait_until
from tests.service.routes.jobs.finished import queued_job
from tests.service.serving import RunningServer

from primray.color.ocio import check_view
from primray.images.image import encode
from primray_service.worker.preview import decode_preview, preview_of, write_preview

WIDTH, HEIGHT = 120, 60


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(dispatch=False)


@pytest.fixture(scope="module")
def client(server: RunningServer) -> Any:
    return server.client()


def scene_like(width: int = WIDTH, height: int = HEIGHT) -> tuple[np.ndarray, np.ndarray]:
    """Ramps from black to bright, with coverage and without, and an error that falls from left to right."""
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    pixels = np.stack([x, y, 1 - x, np.ones_like(x)], axis=2).astype(np.float32)
    pixels[:, : width // 4, :] *= 0.0
    errors = np.repeat((10.0 ** (-1 - 2 * x))[..., None], 3, axis=2).astype(np.float32)
    errors[0] = 0.0
    errors[1] = np.inf
    return pixels, errors


def with_preview(server: RunningServer, passes: int = 1, size: tuple[int, int] = (WIDTH, HEIGHT), job: str = "") -> str:
    job = job or queued_job(server)
    folder = server.data / "jobs" / job / "frames" / "0"
    folder.mkdir(parents=True, exist_ok=True)
    write_preview(preview_of(*scene_like(*size), passes=passes, samples=passes * 16), folder)
    return job


@pytest.fixture(scope="module")
def job(server: RunningServer) -> str:
    return with_preview(server)


def slug(response: Any) -> tuple[int, str]:
    return response.status_code, response.json()["type"].removeprefix("/problems/")


def png(data: bytes) -> np.ndarray:
    """Decoded here, by a reader of this test's own: any filter, 8 bits."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at = 8
    chunks: dict[bytes, bytes] = {}
    while at < len(data):
        (size,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + size]
        assert struct.unpack(">I", data[at + 8 + size : at + 12 + size])[0] == zlib.crc32(kind + body)
        chunks[kind] = chunks.get(kind, b"") + body
        at += 12 + size
    width, height, depth, color, *_ = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    channels = {0: 1, 2: 3, 6: 4}[color]
    assert depth == 8
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + width * channels)
    assert (rows[:, 0] == 2).all()
    return np.cumsum(rows[:, 1:].astype(np.uint32), axis=0).astype(np.uint8).reshape(height, width, channels)


def halves() -> np.ndarray:
    return scene_like()[0].astype(np.float16).astype(np.float32)


@pytest.mark.parametrize("exposure", [0.0, -3.5, 2.0])
def test_beauty_is_what_the_png_output_will_be(exposure: float, job: str, client: Any) -> None:
    response = client.get(f"/v1/jobs/{job}/preview", params={"exposure": exposure})
    assert (response.status_code, response.headers["content-type"]) == (200, "image/png")
    np.testing.assert_array_equal(png(response.content), encode(halves(), exposure=exposure))
    assert response.headers["preview-pass"] == "1"
    assert response.headers["preview-resolution"] == f"{WIDTH}x{HEIGHT}"


@pytest.mark.parametrize(("channel", "weights"), [("r", (1, 0, 0)), ("g", (0, 1, 0)), ("luminance", (0.2126, 0.7152, 0.0722))])
def test_a_channel_alone_is_grey(channel: str, weights: tuple[float, ...], job: str, client: Any) -> None:
    shown = png(client.get(f"/v1/jobs/{job}/preview", params={"channel": channel}).content)
    one = halves()[..., :3] @ np.array(weights, np.float32)
    grey = np.concatenate([np.repeat(one[..., None], 3, axis=2), np.ones_like(one)[..., None]], axis=2)
    np.testing.assert_array_equal(shown, encode(grey))
    assert (shown[..., 0] == shown[..., 1]).mean() > 0.99


def test_the_view_is_named(job: str, client: Any) -> None:
    display, view = check_view(None)
    response = client.get(f"/v1/jobs/{job}/preview")
    assert unquote(response.headers["preview-view"]) == f"{view} ({display})"
    assert "preview-view" not in client.get(f"/v1/jobs/{job}/preview", params={"view": "error"}).headers


def test_coverage_is_linear(job: str, client: Any) -> None:
    shown = png(client.get(f"/v1/jobs/{job}/preview", params={"channel": "a"}).content)
    np.testing.assert_array_equal(shown[..., 0], np.where(np.arange(WIDTH) < WIDTH // 4, 0, 255)[None].repeat(HEIGHT, 0))


@pytest.mark.parametrize("view", ["error", "relative-error"])
def test_the_error_is_a_map_with_its_scale(view: str, job: str, client: Any) -> None:
    response = client.get(f"/v1/jobs/{job}/preview", params={"view": view})
    scale = dict(part.split("=", 1) for part in response.headers["preview-scale"].split(";")[1:])
    shown = png(response.content)
    assert (shown[0] == 0).all()  # no error
    assert (shown[1] == 96).all()  # no estimate
    low, high = float(scale["low"]), float(scale["high"])
    assert low < high
    if view == "error":
        assert (low, high, scale["unit"]) == (1e-3, 1e-1, "radiance")
        np.testing.assert_array_equal(shown[5, 0], (253, 231, 37))  # viridis' last: the most
        np.testing.assert_array_equal(shown[5, -1], (68, 1, 84))
        luminance = shown[5].astype(float) @ (0.2126, 0.7152, 0.0722)
        assert (np.diff(luminance) <= 1).all()


def test_jpeg_is_a_jpeg_of_the_same(job: str, client: Any, tmp_path: Path) -> None:
    import OpenImageIO as oiio

    response = client.get(f"/v1/jobs/{job}/preview", params={"format": "jpeg"})
    assert response.headers["content-type"] == "image/jpeg"
    (tmp_path / "a.jpg").write_bytes(response.content)
    shown = oiio.ImageBuf(str(tmp_path / "a.jpg")).get_pixels(oiio.UINT8)
    expected = encode(halves()).astype(float)
    over_black = expected[..., :3] * expected[..., 3:] / 255
    assert shown is not None
    assert shown.shape == (HEIGHT, WIDTH, 3)
    assert np.abs(shown - over_black).mean() < 6


def test_raw_is_the_numbers(job: str, client: Any) -> None:
    response = client.get(f"/v1/jobs/{job}/preview", params={"format": "raw"})
    preview = decode_preview(response.content)
    np.testing.assert_array_equal(preview.rgb, halves()[..., :3])
    part = client.get(f"/v1/jobs/{job}/preview", params={"format": "raw"}, headers={"range": "bytes=0-7"})
    assert (part.status_code, part.content) == (206, b"primrayP")


@pytest.mark.parametrize(("width", "shape"), [(60, (30, 60)), (50, (20, 40)), (1, (1, 1)), (5000, (HEIGHT, WIDTH))])
def test_a_width_is_never_exceeded(width: int, shape: tuple[int, int], job: str, client: Any) -> None:
    for view in ("beauty", "error"):
        shown = png(client.get(f"/v1/jobs/{job}/preview", params={"width": width, "view": view}).content)
        assert shown.shape[:2] == shape
    boxes = png(client.get(f"/v1/jobs/{job}/preview", params={"width": 60, "channel": "a"}).content)[..., 0]
    assert (boxes[0, :15] == 0).all()
    assert (boxes[0, 15:] == 255).all()


def test_the_etag_is_of_the_pass_and_of_what_is_asked(server: RunningServer, client: Any) -> None:
    job = with_preview(server)
    path = f"/v1/jobs/{job}/preview"
    first = client.get(path)
    tag = first.headers["etag"]
    assert client.get(path, headers={"if-none-match": tag}).status_code == 304
    assert client.head(path).headers["etag"] == tag
    assert client.get(path, params={"exposure": 1}, headers={"if-none-match": tag}).status_code == 200
    with_preview(server, passes=2, job=job)
    second = client.get(path, headers={"if-none-match": tag})
    assert second.status_code == 200
    assert (second.headers["preview-pass"], second.headers["preview-samples"]) == ("2", "32")
    assert second.headers["etag"] != tag


def test_where_there_is_no_picture_yet_it_says_when_to_ask_again(server: RunningServer, client: Any) -> None:
    response = client.get(f"/v1/jobs/{queued_job(server)}/preview")
    assert slug(response) == (404, "not-found")
    assert response.json()["state"] == "queued"
    assert response.headers["retry-after"] == "1"


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ({"view": "albedo"}, (422, "view-unavailable")),
        ({"view": "error", "channel": "a"}, (422, "view-unavailable")),
        ({"exposure": "nan"}, (422, "invalid-request")),
        ({"exposure": "1e9"}, (422, "invalid-request")),
        ({"width": "0"}, (422, "invalid-request")),
        ({"width": "99999999"}, (422, "invalid-request")),
        ({"format": "gif"}, (422, "invalid-request")),
        ({"channel": "x"}, (422, "invalid-request")),
        ({"frame": "1"}, (404, "not-found")),
    ],
)
def test_what_cannot_be_shown_is_told(params: dict[str, str], expected: tuple[int, str], job: str, client: Any) -> None:
    response = client.get(f"/v1/jobs/{job}/preview", params=params)
    assert slug(response) == expected
    if expected[1] == "view-unavailable":
        assert response.json()["views"] == ["beauty", "error", "relative-error"]


@pytest.mark.parametrize("damage", [lambda d: d[:200], lambda d: b"x" + d[1:], lambda d: d + b"x", lambda d: b""])
def test_a_damaged_preview_is_no_picture(damage: Any, server: RunningServer, client: Any) -> None:
    job = with_preview(server)
    file = server.data / "jobs" / job / "frames" / "0" / "preview.raw"
    file.write_bytes(damage(file.read_bytes()))
    response = client.get(f"/v1/jobs/{job}/preview")
    assert slug(response) in ((503, "unavailable"), (404, "not-found"))
    assert client.get(f"/v1/jobs/{with_preview(server)}/preview").status_code == 200


def helper_of(server: RunningServer) -> int | None:
    found = subprocess.run(["ps", "-ww", "-o", "pid=,args=", "--ppid", str(server.process.pid)], capture_output=True, text=True)
    lines = [line.split(None, 1) for line in found.stdout.splitlines()]
    return next((int(pid) for pid, command in lines if "pictures.process" in command), None)


def shown_at_last(client: Any, job: str, exposure: float) -> Any:
    """The answer with the picture: on a busy machine the helper may not start in the time that a request waits for it (503)."""

    def answer() -> Any:
        response = client.get(f"/v1/jobs/{job}/preview", params={"exposure": exposure})
        assert response.status_code in (200, 503), response.text
        return response if response.status_code == 200 else None

    return wait_until(answer, timeout_s=180.0)


def test_a_helper_that_dies_is_started_again_and_ends_with_its_server(server: RunningServer, start_server: Any) -> None:
    mine = start_server(dispatch=False)
    client = mine.client()
    job = with_preview(mine)
    first = shown_at_last(client, job, exposure=0)
    pid = helper_of(mine)
    assert pid is not None, first.headers
    os.kill(pid, signal.SIGKILL)
    wait_until(lambda: helper_of(mine) != pid)
    second = shown_at_last(client, job, exposure=1)
    pid = helper_of(mine)
    assert pid is not None, second.headers
    mine.stop(signal.SIGKILL)
    wait_until(lambda: not Path(f"/proc/{pid}").exists(), timeout_s=60.0)


def test_the_server_answers_others_while_large_pictures_are_made(server: RunningServer) -> None:
    job = with_preview(server, size=(1024, 1024))
    client = server.client()
    client.get("/healthz")
    done = threading.Event()

    def look() -> None:
        with_pictures = server.client()
        for step in range(6):
            with_pictures.get(f"/v1/jobs/{job}/preview", params={"exposure": 0.1 * (step + 1)})
        done.set()

    looking = threading.Thread(target=look)
    looking.start()
    waits = []
    while not done.is_set():
        began = time.perf_counter()
        assert client.get("/healthz").status_code == 200
        waits.append(time.perf_counter() - began)
    looking.join()
    assert len(waits) > 10
    assert sorted(waits)[len(waits) * 9 // 10] < 0.1, json.dumps(sorted(waits)[-5:])


def test_pictures_for_a_person_to_look_at(server: RunningServer, client: Any, tmp_path: Path) -> None:
    """Kept under $PRIMRAY_KEEP where that is set."""
    folder = Path(os.environ.get("PRIMRAY_KEEP", tmp_path))
    job = with_preview(server, size=(480, 240))
    for name, params in {"beauty": {}, "error": {"view": "error"}, "relative": {"view": "relative-error"}}.items():
        data = client.get(f"/v1/jobs/{job}/preview", params=params).content
        (folder / f"preview-{name}.png").write_bytes(data)
        assert png(io.BytesIO(data).getvalue()).shape[:2] == (240, 480)
