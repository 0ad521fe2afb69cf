"""In a real kernel: a bar while a render runs, the picture with its diagnostics under it, completion of settings by name."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("ipykernel", reason="no IPython")
manager = pytest.importorskip("jupyter_client.manager", reason="no IPython")

STAGE = '#usda 1.0\ndef Sphere "s" {\n}\ndef DomeLight "d" {\n asset inputs:texture:file = @no.exr@\n}\n'


class Kernel:
    def __init__(self, client: Any) -> None:
        self.client = client

    def run(self, code: str) -> list[dict[str, Any]]:
        """What a front end gets to show, in order; what replaces an output too."""
        shown: list[dict[str, Any]] = []

        def hear(message: dict[str, Any]) -> None:
            if message["msg_type"] == "error":
                pytest.fail("\n".join(message["content"]["traceback"]))
            if message["msg_type"] in ("display_data", "update_display_data", "execute_result"):
                shown.append(message["content"]["data"])

        self.client.execute_interactive(code, output_hook=hear, timeout=120)
        return shown

    def complete(self, code: str) -> set[str]:
        reply = self.client.complete(code, reply=True, timeout=60)
        return set(reply["content"]["matches"])


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kernel]:
    folder: Path = tmp_path_factory.mktemp("notebook")
    (folder / "s.usda").write_text(STAGE)
    (folder / "clean.usda").write_text('#usda 1.0\ndef Sphere "s" {\n}\n')
    kernels, client = manager.start_new_kernel(kernel_name="python3", cwd=str(folder))
    try:
        found = Kernel(client)
        found.run("import primray")
        yield found
    finally:
        client.stop_channels()
        kernels.shutdown_kernel(now=True)


def test_a_render_shows_a_bar_then_its_picture_and_what_it_lacks(kernel: Kernel) -> None:
    shown = kernel.run('primray.render("s.usda", resolution=(64, 36), spp=64)')
    assert "<progress" in shown[0]["text/html"]
    assert shown[-2]["text/html"] == ""
    assert "data:image/png" in shown[-1]["text/html"]
    assert "asset-missing" in shown[-1]["text/html"]
    assert "image/png" in shown[-1]
    assert shown[-1]["text/plain"].startswith("<Image 64 x 36, RGBA, 64 samples a pixel")


def test_a_picture_without_errors_is_a_png(kernel: Kernel) -> None:
    kernel.run('image = primray.render("clean.usda", resolution=(8, 8), spp=2, progress=False)')
    assert "data-primray" in kernel.run("image.show()")[0]["text/html"]
    shown = kernel.run("primray.Image(image.pixels).show()")
    assert [sorted(data) for data in shown] == [["image/png", "text/plain"]]


def test_completion(kernel: Kernel) -> None:
    assert {"render_products", "Camera", "read_image", "compare"} <= {
        text.removeprefix("primray.") for text in kernel.complete("primray.")
    }
    assert any(text.startswith("time_limit_s") for text in kernel.complete('primray.render("a", time_'))
