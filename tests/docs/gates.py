"""The rules of layout as functions from (path, text) to sentences on what breaks them; test_gates.py runs them all."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import PurePosixPath

MAX_LINES = 500
VAGUE_NAMES = {"utils", "util", "common", "misc", "helpers", "helper", "manager"}
WEB = {"fastapi", "starlette", "uvicorn"}
SQL = {"sqlalchemy", "alembic", "sqlite3", "psycopg"}

Gate = Callable[[PurePosixPath, str], Iterator[str]]


def imported_modules(path: PurePosixPath, text: str) -> Iterator[str]:
    """Absolute names of everything a Python file imports, those inside functions too."""
    package = ".".join(path.with_suffix("").parts[1:])  # below renderer/, service/ or tests/
    base = package.removesuffix(".__init__").split(".") if path.name == "__init__.py" else package.split(".")[:-1]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parent = base[: len(base) - node.level + 1] if node.level else []
            module = ".".join([*parent, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


def is_under(path: PurePosixPath, folder: str) -> bool:
    return path.is_relative_to(folder)


def imports_point_one_way(path: PurePosixPath, text: str) -> Iterator[str]:
    """service -> primray -> core; usd/ never imports the core."""
    if path.suffix != ".py" or is_under(path, "tests"):
        return
    for module in imported_modules(path, text):
        names = module.split(".")
        if is_under(path, "renderer") and names[0] == "primray_service":
            yield f"imports {module}: the renderer knows no service"
        if (
            is_under(path, "renderer/primray/usd")
            and names[0] == "primray"
            and names[1:2]
            and re.match(r"_?core|render$", names[1])
        ):
            yield f"imports {module}: translation knows no core"
        if names[-1].startswith("_core_v") and path != PurePosixPath("renderer/primray/core.py"):
            yield f"imports {module}: only primray/core.py chooses the module"


def one_gate_per_dependency(path: PurePosixPath, text: str) -> Iterator[str]:
    if path.suffix == ".py" and not is_under(path, "tests"):
        for module in imported_modules(path, text):
            root = module.split(".")[0]
            if root == "pxr" and not is_under(path, "renderer/primray/usd"):
                yield "imports pxr outside primray/usd"
            if root in WEB and path.name not in ("app.py", "routes.py"):
                yield f"imports {root} outside app.py and routes.py"
            if root in SQL and path.name != "store.py":
                yield f"imports {root} outside store.py"
    if is_under(path, "renderer/core") and path.suffix in (".cpp", ".hpp", ".h"):
        if not is_under(path, "renderer/core/accel") and re.search(r"\b(rtc[A-Z]\w+|RTC[A-Z_]\w+)\b", without_comments(text)):
            yield "names Embree outside core/accel"
        if not is_under(path, "renderer/core/bindings") and re.search(r"#include\s*<nanobind|\bnanobind::|\bnb::", text):
            yield "uses nanobind outside core/bindings"
        if re.search(r'#include\s*[<"]pxr/', text):
            yield "the core knows no USD"


def without_comments(text: str) -> str:
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)


def files_are_short(path: PurePosixPath, text: str) -> Iterator[str]:
    lines = text.count("\n")
    if lines > MAX_LINES:
        yield f"has {lines} lines; {MAX_LINES} are allowed"


def names_say_something(path: PurePosixPath, text: str) -> Iterator[str]:
    vague = VAGUE_NAMES & {part.lower() for part in (*path.parts[:-1], path.stem)}
    if vague:
        yield f"is called {', '.join(sorted(vague))}, which says nothing"


def files_say_what_they_are(path: PurePosixPath, text: str) -> Iterator[str]:
    starts = {".py": ('"""', "#!"), ".cpp": ("//", "/*"), ".hpp": ("//", "/*"), ".h": ("//", "/*")}[path.suffix]
    if text.strip() and not text.startswith(starts):
        yield "does not open with what it is"


GATES: tuple[Gate, ...] = (
    imports_point_one_way,
    one_gate_per_dependency,
    files_are_short,
    names_say_something,
    files_say_what_they_are,
)
