"""What a client can read names no place on the server's machine: no folder, no layer in memory, in no answer and no file."""

from __future__ import annotations

import json
import re
import sys
import tempfile
from pathlib import Path

import OpenImageIO as oiio
import pytest
from tests.service.serving import RunningServer
from tests.service.threats.fates import Fate, fate, package
from tests.service.words.bad_stages import BALL, MATERIAL, REFUSED, RENDERED, sublayers, truncated_crate

BROKEN_PICTURE = b"\x89PNG\r\n\x1a\n" + bytes(20)


def bodies(folder: Path) -> dict[str, tuple[bytes, str, str | None]]:
    """What is sent, its name, and the root layer in it."""
    found: dict[str, tuple[bytes, str, str | None]] = {}
    crate = truncated_crate(folder)
    packages = RENDERED | {"truncated crate below": {"shot.usda": sublayers("bad.usdc"), "bad.usdc": crate}}
    packages["damaged picture"] = {"shot.usda": f"#usda 1.0\n{BALL}{MATERIAL}", "textures/wood.png": BROKEN_PICTURE}
    packages["in a folder"] = {f"a/b/{name}": data for name, data in RENDERED["parse error in a reference"].items()}
    for name, files in (packages | REFUSED).items():
        entry = next(iter(files))
        found[name] = (package(files), "shot.zip", entry)
        if len(files) == 1:
            data = files[entry]
            found[f"{name}, alone"] = (data if isinstance(data, bytes) else data.encode(), "shot.usda", None)
    found["truncated crate"] = (crate, "shot.usdc", None)
    found["broken usdz"] = (b"PK\x03\x04" + bytes(200), "shot.usdz", None)
    found["layers in no usdz"] = (package({"a.usda": REFUSED["parse error"]["shot.usda"]}), "shot.usdz", None)
    found["a name that is none"] = (REFUSED["parse error"]["shot.usda"].encode(), "../@x[1].usda", None)  # type: ignore[union-attr]
    return found


CASES = [*RENDERED, *REFUSED, *(f"{name}, alone" for name, files in (RENDERED | REFUSED).items() if len(files) == 1)]
CASES += ["truncated crate below", "damaged picture", "in a folder", "truncated crate", "broken usdz", "layers in no usdz"]
CASES += ["a name that is none"]


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[bytes, str, str | None]]:
    return bodies(tmp_path_factory.mktemp("made"))


def readable(found: Fate, server: RunningServer) -> dict[str, str]:
    """Everything, by where it is read."""
    texts = {"answers": found.said}
    client = server.client()
    for output in client.get(f"/v1/jobs/{found.job['id']}/outputs").json()["items"] if found.job else []:
        data = client.get(output["urls"]["self"]).content
        if output["name"].endswith(".json"):
            texts[output["name"]] = data.decode()
        elif output["name"].endswith(".exr"):
            with tempfile.NamedTemporaryFile(suffix=".exr") as file:
                file.write(data)
                file.flush()
                picture = oiio.ImageInput.open(file.name)  # ImageBuf would add the path of this very file
                assert picture is not None
                header = picture.spec().extra_attribs
                texts[output["name"]] = json.dumps({attribute.name: str(attribute.value) for attribute in header})
    return texts


@pytest.mark.parametrize("name", CASES)
def test_no_place_of_the_server_is_told(
    name: str, sent: dict[str, tuple[bytes, str, str | None]], server: RunningServer
) -> None:
    body, called, entry = sent[name]
    found = fate(server.client(), body, name=called, entry=entry)
    places = [str(server.data), str(server.data.parent), sys.prefix, sys.base_prefix, str(Path(__file__).parents[3])]
    for where, text in readable(found, server).items():
        for place in places:
            assert place not in text, (where, text)
        assert not re.search(r"anon:|/(?:tmp|job|out|package|slots?)/", text), (where, text)
        assert not re.search(r"[\s@<\"'(]/(?!problems/|v1/)[\w.\-/]+\.(?:usd[acz]?|py|png|exr|json|so|txt)\b", text), (
            where,
            text,
        )
