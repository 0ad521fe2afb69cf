"""docs/aovs.md names every AOV with its channels, and every name of a RenderVar that means one."""

from __future__ import annotations

import re
from pathlib import Path

from primray.aovs import AOVS, NAMED_LIGHT_PATHS
from primray.images.aov import channel_names
from primray.usd.render_settings.render_var import COMMON, OF_PATHS

TEXT = (Path(__file__).parents[3] / "docs" / "aovs.md").read_text()


def test_the_table_is_complete() -> None:
    rows = dict(re.findall(r"^\| `([a-z_:A-Z<>]+)` \| (.*? \| .*) \|$", TEXT, re.MULTILINE))
    assert set(rows) == {*AOVS, *NAMED_LIGHT_PATHS, "primvar:NAME", "C<RD>L", "lights"}
    for name, kind in AOVS.items():
        channels, _, names = rows[name].split(" | ")
        first, *more = channel_names(name, kind.channels)
        written = " ".join([first, *(channel.rpartition(".")[2] for channel in more)])
        assert channels == f"`{written}`" + (" (UINT)" if kind.unsigned else "")
        assert sorted(re.findall(r"`([^`]+)`", names)) == sorted(COMMON.get(name, ()))
    for name, path in NAMED_LIGHT_PATHS.items():
        channels, meaning, names = rows[name].split(" | ")
        assert channels == f"`{name}.R G B`"
        assert f"`{path}`" in meaning
        assert sorted(re.findall(r"`([^`]+)`", names)) == sorted(OF_PATHS[name])
