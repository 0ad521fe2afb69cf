"""Who imports whom among the project's Python modules, type-checking imports included, and the rules that this has to keep.

Imports inside functions are put off on purpose and don't make circles; the order of folders holds for them too.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from .gates import names_imported

Graph = Mapping[str, Collection[str]]

# Of renderer/primray: files of its own and folders, each importing only those before it.
ORDER = (
    "version",
    "errors",
    "garbage",
    "arrays",
    "lens",
    "camera",
    "setting_values",
    "camera_choice",
    "installed_packages",
    "lfs_pointer",
    "other_formats",
    "aov_names",
    "light_paths",
    "aov_data_types",
    "composition",
    "fidelity",
    "diagnostic_codes",
    "refusal",
    "diagnostics",
    "settings",
    "notices",
    "color",
    "description",
    "photometry",
    "textures",
    "refine",
    "usd",
    "core",
    "sampling",
    "staging",
    "images",
    "diffusing",
    "denoising",
    "report",
    "checkpoints",
    "parts",
    "render",
    "examining",
    "keeping",
    "live",
    "compare",
    "cli",
)


@dataclass(frozen=True)
class Import:
    importer: str  # modules by their absolute names, packages without "__init__"
    imported: str
    deferred: bool  # inside a function


def imports_of(sources: Mapping[PurePosixPath, str]) -> list[Import]:
    """Those of one another, by files' paths below renderer/ or service/."""
    texts = {module_of(path): (path, text) for path, text in sources.items()}
    found = []
    for module, (path, text) in texts.items():
        tree = ast.parse(text)
        inner = {id(node) for function in _functions(tree) for node in ast.walk(function)}
        for node in ast.walk(tree):
            for name in names_imported(path, node):
                target = name if name in texts else name.rpartition(".")[0]
                if target in texts and target != module:
                    found.append(Import(module, target, id(node) in inner))
    return found


def module_of(path: PurePosixPath) -> str:
    return ".".join(path.with_suffix("").parts[1:]).removesuffix(".__init__")


def _functions(tree: ast.AST) -> Iterator[ast.AST]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))


def graph_of(found: Iterable[Import]) -> dict[str, set[str]]:
    graph: dict[str, set[str]] = defaultdict(set)
    for one in found:
        if not one.deferred:
            graph[one.importer].add(one.imported)
            graph[one.imported]  # has a place
    return dict(graph)


def circles(graph: Graph) -> list[list[str]]:
    """Sets of nodes that can all be reached from one another (Tarjan 1972)."""
    numbers: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        numbers[node] = low[node] = len(numbers)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in numbers:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], numbers[other])
        if low[node] == numbers[node]:
            at = stack.index(node)
            members = stack[at:]
            del stack[at:]
            if len(members) > 1:
                found.append(sorted(members))

    for node in sorted(graph):
        if node not in numbers:
            visit(node)
    return sorted(found)


def order_faults(found: Iterable[Import], package: str, order: tuple[str, ...]) -> Iterator[str]:
    """Imports of a later folder of the package, or of the same row of its table, and folders that have no place."""
    for one in found:
        rows = [name.removeprefix(f"{package}.").split(".")[0] for name in (one.importer, one.imported)]
        if package in (one.importer, one.imported) or rows[0] == rows[1]:
            continue  # the package's own names, or inside a folder
        if unknown := [row for row in rows if row not in order]:
            yield f"{unknown[0]} has no place in the order"
        elif order.index(rows[1]) > order.index(rows[0]):
            yield f"{one.importer} imports {one.imported}, which comes later"


def rooms(found: Iterable[Import], package: str) -> dict[str, set[str]]:
    """Which folder of the package imports which others; its own files are no folder."""
    graph: dict[str, set[str]] = defaultdict(set)
    for one in found:
        parts = [name.removeprefix(f"{package}.").split(".") for name in (one.importer, one.imported)]
        if one.deferred or not all(name.startswith(f"{package}.") for name in (one.importer, one.imported)):
            continue
        first, second = (part[0] for part in parts)
        if first != second:
            graph[first].add(second)
            graph[second]
    return dict(graph)


def sources(root: Path) -> dict[PurePosixPath, str]:
    found = {}
    for folder in ("renderer/primray", "service/primray_service"):
        for path in sorted((root / folder).rglob("*.py")):
            found[PurePosixPath(path.relative_to(root).as_posix())] = path.read_text(encoding="utf-8")
    return found
