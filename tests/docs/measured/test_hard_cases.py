"""docs/hard-cases.md is what tests/hard measured, and every test there that declares a case has its row."""

from __future__ import annotations

import ast
import json

from .hard_cases import MEASURED, PAGE, ROOT, page


def test_the_page_is_fresh():
    assert PAGE.read_text(encoding="utf-8") == page(), "docs/hard-cases.md is stale; run `make docs`"


def test_each_declared_case_has_a_row_and_each_row_a_test():
    for file in sorted((ROOT / "tests" / "hard").rglob("test_*.py")):
        declared = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and any("hard_case" in ast.dump(d) for d in node.decorator_list):
                declared.add(node.name)
        kept = MEASURED / f"{file.stem}.json"
        rows = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
        assert declared == {name.partition("[")[0] for name in rows}, f"{file.name}: run it with PRIMRAY_UPDATE=1"
