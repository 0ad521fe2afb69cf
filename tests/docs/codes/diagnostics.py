"""docs/diagnostics.md's table, from diagnostics.CODES. `python -m tests.docs.codes.diagnostics` rewrites it."""

from __future__ import annotations

from pathlib import Path

from primray.diagnostic_codes import CODES, Severity

PAGE = Path(__file__).resolve().parents[3] / "docs" / "diagnostics.md"
BEGIN = "<!-- generated from diagnostics.CODES by `make docs`: begin -->"
END = "<!-- generated: end -->"


def table() -> str:
    """Markdown: one row for each code, what costs most first."""
    rows = ["| code | severity | what it means |", "|---|---|---|"]
    for severity in (Severity.ERROR, Severity.WARNING, Severity.INFO):
        for name, code in sorted(CODES.items()):
            if code.severity is severity:
                rows.append(f"| `{name}` | {severity.value} | {code.meaning.replace('|', chr(92) + '|')} |")
    return "\n".join(rows)


def with_table(page: str) -> str:
    """The page with the table between its marks made new."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
