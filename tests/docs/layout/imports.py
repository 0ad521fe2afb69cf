"""The import graph of the project's Python modules, type-checking imports included, and the rules for it.

An import inside a function is deferred on purpose and closes no circle; the layers hold for it too.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from .gates import names_imported

Graph = Mapping[str, Collection[str]]

# Layers of renderer/primray, lowest first: a module imports from its own layer and from those below it.
LAYERS: Mapping[str, tuple[str, ...]] = {
    "foundation": (
        "version",
        "errors",
        "arrays",
        "content_hash",
        "installed_packages",
        "file_formats",
        "composition",
        "read_files",
        "diagnostic_codes",
        "process_memory",
        "time_spans",
        "diagnostics",
        "diagnostic_messages",
    ),
    "requests": ("lens", "camera", "aovs", "lpe", "settings"),
    "scene description": ("color", "volumes", "description", "photometry"),
    "translation": ("textures", "tessellation", "usd"),
    "core": ("core",),
    "rendering": (
        "sampling",
        "staging",
        "images",
        "labels",
        "light_mix",
        "denoising",
        "report",
        "checkpoints",
        "distributed",
        "render",
    ),
    "tools": (
        "diagnosis",
        "incremental",
        "live",
        "notebook",
        "compare",
        "ci",
        "pinned",
        "explanation",
        "dataset",
        "sensor",
        "light_meter",
    ),
    "command line": ("cli",),
}


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


def layer_faults(found: Iterable[Import], package: str, layers: Mapping[str, tuple[str, ...]]) -> Iterator[str]:
    """Yield a sentence for each import from a higher layer of the package, and for each module that is in no layer."""
    rank = {name: k for k, names in enumerate(layers.values()) for name in names}
    for one in found:
        first, second = (name.removeprefix(f"{package}.").split(".")[0] for name in (one.importer, one.imported))
        if package in (one.importer, one.imported):
            continue  # the names that the package itself offers
        if unknown := [name for name in (first, second) if name not in rank]:
            yield f"{unknown[0]} is in no layer"
        elif rank[second] > rank[first]:
            yield f"{one.importer} imports {one.imported}, which is in a higher layer"


def sources(root: Path) -> dict[PurePosixPath, str]:
    found = {}
    for folder in ("renderer/primray", "service/primray_service"):
        for path in sorted((root / folder).rglob("*.py")):
            found[PurePosixPath(path.relative_to(root).as_posix())] = path.read_text(encoding="utf-8")
    return found
