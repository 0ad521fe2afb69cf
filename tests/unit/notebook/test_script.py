"""Modules that become one: their names stay apart, and what cannot be bundled is refused."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from primray import notebook
from primray.notebook.script import bundled


def run(script: str, folder: Path) -> str:
    if shutil.which("node") is None:
        pytest.skip("skipped: no node")
    (folder / "all.mjs").write_text(f"{script}\n")
    code = f'import("{folder / "all.mjs"}").then(async (m) => console.log(await m.default.run()))'
    return subprocess.run(["node", "-e", code], capture_output=True, text=True, check=True, timeout=60).stdout.strip()


def test_names_of_modules_stay_apart(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner/a.js").write_text("const own = 2;\nexport const twice = (x) => own * x;\n")
    (tmp_path / "b.js").write_text(
        'import { twice } from "./inner/a.js";\nconst own = 10;\nexport async function more(x) {\n  return own + twice(x);\n}\n'
    )
    (tmp_path / "c.js").write_text(
        'import { more } from "./b.js";\nimport { twice } from "./inner/a.js";\nconst own = 1;\n'
        "const run = async () => own + twice(await more(3));\nexport default { run };\n"
    )
    script = bundled(tmp_path / "c.js")
    assert script.count("const own = 2") == 1
    assert run(script, tmp_path) == "33"


@pytest.mark.parametrize("line", ['import * as a from "./a.js";', 'export * from "./a.js";', "export class A {}"])
def test_what_cannot_be_bundled_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "a.js").write_text("export const x = 1;\n")
    (tmp_path / "c.js").write_text(f"{line}\nexport default {{}};\n")
    with pytest.raises(ValueError, match=r"c\.js: this cannot be bundled"):
        bundled(tmp_path / "c.js")


def test_the_widget_needs_nothing_from_elsewhere(tmp_path: Path) -> None:
    script = bundled(Path(notebook.__file__).parent / "page/widget.js")
    assert "https:" not in script
    assert "fetch(" not in script
    (tmp_path / "all.mjs").write_text(script)
    if shutil.which("node") is not None:
        subprocess.run(["node", "--check", tmp_path / "all.mjs"], check=True, timeout=60)
