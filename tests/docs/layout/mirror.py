"""Lists the product modules whose tests are not found by their path.

    python -m tests.docs.layout.mirror

Tests of `renderer/primray/a/b.py` are `tests/unit/a/test_b.py` and `tests/unit/a/test_b_*.py`; the service has its own below
`tests/service`, by the same rule. A module without any may be tested through others (tests/images, tests/translation), which a
path does not tell.
"""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
MIRRORS = {"renderer/primray": "tests/unit", "service/primray_service": "tests/service"}


def tests_of(module: Path) -> list[Path]:
    """Return the test files that the rule gives for a product module."""
    for source, tests in MIRRORS.items():
        if module.is_relative_to(ROOT / source):
            folder = ROOT / tests / module.relative_to(ROOT / source).parent
            return sorted({*folder.glob(f"test_{module.stem}.py"), *folder.glob(f"test_{module.stem}_*.py")})
    return []


def modules() -> list[Path]:
    """Return every product module that defines something."""
    found = [path for source in MIRRORS for path in sorted((ROOT / source).rglob("*.py"))]
    return [path for path in found if path.name not in ("__init__.py", "__main__.py") and "migrations" not in path.parts]


def main() -> None:
    without = [path for path in modules() if not tests_of(path)]
    for path in without:
        print(path.relative_to(ROOT))
    print(f"{len(modules())} modules, {len(without)} without tests that their path leads to")


if __name__ == "__main__":
    main()
