"""The rules of layout as functions from (path, text) to sentences on what breaks them; test_gates.py runs them all."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import PurePosixPath

VAGUE_NAMES = {"utils", "util", "common", "misc", "helpers", "helper", "manager"}
WEB = {"starlette"}
HTTP_SERVER = {"uvicorn", "h11"}
SERVICE = "service/primray_service"
SERVERS = tuple(f"{SERVICE}/{name}" for name in ("server.py", "live/server.py", "agents/server.py"))
HTTP = (f"{SERVICE}/http", f"{SERVICE}/routes")
EMBREE = ("renderer/core/embree", "renderer/core/accel", "renderer/core/bvh")  # the last has Embree build its hierarchies
USD = "renderer/primray/usd"
# What goes through a stage, or says which of its prims are seen; and what says when an attribute has values. Each has one file.
SEARCHES = """AllPrims GetAllChildren GetAllDescendants GetChildren GetDescendants GetFilteredChildren GetFilteredDescendants
    HasDefiningSpecifier IsAbstract PrimAllPrimsPredicate
    PrimDefaultPredicate PrimHasClassSpecifier PrimHasDefiningSpecifier PrimIsAbstract PrimIsActive PrimIsDefined PrimIsLoaded
    PrimRange Traverse TraverseAll TraverseInstanceProxies"""
TIMES = """EarliestTime GetBracketingTimeSamples GetNumTimeSamples GetSpline GetTimeSamples GetTimeSamplesInInterval
    GetUnionedTimeSamples GetUnionedTimeSamplesInInterval HasSpline ListAllTimeSamples ListTimeSamplesForPath
    TransformMightBeTimeVarying ValueMightBeTimeVarying"""
# What USD may fail to give though the stage is open; and the metadata of stages and layers.
FALLIBLE = """ComputeMaskAtTime ComputePurpose ComputeVisibility Get GetAppliedAPISchemas GetAppliedSchemas
    GetAttributes GetAuthoredAttributes GetAuthoredProperties GetAuthoredPropertyNames GetColorSpace
    GetConnectedSource GetConnectedSources GetConnections GetElementSize GetForwardedTargets GetIndices GetInterpolation
    GetLocalToWorldTransform GetLocalTransformation GetMetadata GetNormalsInterpolation GetOpTransform GetOrderedXformOps
    GetParentToWorldTransform GetResetXformStack GetShaderId GetTargets HasColorSpace"""
STAGE_METADATA = """GetDefaultPrim GetEndTimeCode GetFramesPerSecond GetInfo GetStageMetersPerUnit GetStageUpAxis
    GetStartTimeCode GetTimeCodesPerSecond HasAuthoredTimeCodeRange HasDefaultPrim HasTimeCodesPerSecond customLayerData
    defaultPrim endTimeCode expressionVariables framesPerSecond startTimeCode timeCodesPerSecond"""
ONE_PLACE = {
    f"{USD}/stage/reads.py": frozenset(FALLIBLE.split()),
    f"{USD}/stage/metadata.py": frozenset(STAGE_METADATA.split()),
    f"{USD}/stage/traversal.py": frozenset(SEARCHES.split()),
    f"{USD}/stage/time_varying.py": frozenset(TIMES.split()),
}
# What reads at the time of the render by itself has to know what is read where there is no frame.
TIMES_OF_RENDER = {
    f"{USD}/materials/texture_files.py",  # the frame's number, which nodes of time and names of files hold
    f"{USD}/stage/values.py",
    f"{USD}/scene/inheritance.py",  # transforms: local_matrix asks read where something has no default
    f"{USD}/scene/bounds.py",  # at the earliest time of all
    f"{USD}/skinning/baking.py",  # values that are held as defaults by then
}
DEFAULT_TIMES = {
    f"{USD}/inspect/scene_facts.py",  # in which layers a default is authored
    f"{USD}/incremental/translation.py",  # to make a When
    f"{USD}/stage/reads.py",
    f"{USD}/stage/time_varying.py",
    f"{USD}/stage/values.py",
    f"{USD}/skinning/bindings.py",  # values that are held as defaults by then
    f"{USD}/skinning/baking.py",  # likewise
}
WIDGETS = {"anywidget", "ipywidgets", "traitlets"}
NOTEBOOK = "renderer/primray/notebook/view.py"
MCP = f"{SERVICE}/agents/server.py"
DATASET_RAY = "renderer/primray/dataset/ray_workers.py"
RAY = (f"{SERVICE}/executor/ray/driver", f"{SERVICE}/executor/ray/node", DATASET_RAY)
OBJECTS = {"fsspec", "s3fs", "boto3", "botocore"}
BLOSC = "renderer/primray/volumes/vdb_values.py"
SQL = {"sqlalchemy", "alembic", "sqlite3", "psycopg"}

Gate = Callable[[PurePosixPath, str], Iterator[str]]


def imported_modules(path: PurePosixPath, text: str) -> Iterator[str]:
    """Absolute names of everything a Python file imports, those inside functions too."""
    for node in ast.walk(ast.parse(text)):
        yield from names_imported(path, node)


def names_imported(path: PurePosixPath, node: ast.AST) -> Iterator[str]:
    """Absolute names of what one node of a file imports, if it is an import."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        package = ".".join(path.with_suffix("").parts[1:])  # below renderer/, service/ or tests/
        base = package.removesuffix(".__init__").split(".") if path.name == "__init__.py" else package.split(".")[:-1]
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
        if is_under(path, USD) and names[0] == "primray" and names[1:2] and re.match(r"_?core|render$", names[1]):
            yield f"imports {module}: translation knows no core"
        if names[-1].startswith("_core_v") and path != PurePosixPath("renderer/primray/core/native.py"):
            yield f"imports {module}: only primray/core/native.py chooses the module"


def one_gate_per_dependency(path: PurePosixPath, text: str) -> Iterator[str]:
    if path.suffix == ".py" and not is_under(path, "tests"):
        for module in imported_modules(path, text):
            root = module.split(".")[0]
            if root == "pxr" and not is_under(path, USD):
                yield "imports pxr outside primray/usd"
            if root == "MaterialX" and not is_under(path, f"{USD}/materials/materialx"):
                yield "imports MaterialX outside usd/materials/materialx"
            if root in WEB and path.name != "app.py" and not any(is_under(path, folder) for folder in HTTP):
                yield f"imports {root} outside app.py, http/ and routes/"
            if root in HTTP_SERVER and str(path) not in SERVERS:
                yield f"imports {root} outside server.py, live/server.py and agents/server.py"
            if root == "ray" and not any(is_under(path, folder) for folder in RAY):
                where = "executor/ray/driver, executor/ray/node and dataset/ray_workers.py"
                yield f"imports ray outside {where}: the server has no Ray in its process"
            if root in OBJECTS and path != PurePosixPath(f"{SERVICE}/objects.py"):
                yield f"imports {root} outside objects.py"
            if root in WIDGETS and str(path) != NOTEBOOK:
                yield f"imports {root} outside notebook/view.py"
            if root in ("mcp", "mcp_types") and str(path) != MCP:
                yield "imports mcp outside agents/server.py"
            if root == "blosc" and str(path) != BLOSC:
                yield "imports blosc outside volumes/vdb_values.py"
            if root in SQL and not is_under(path, f"{SERVICE}/store"):
                yield f"imports {root} outside store/"
    if is_under(path, "renderer/core") and path.suffix in (".cpp", ".hpp", ".h"):
        if not any(is_under(path, folder) for folder in EMBREE) and re.search(
            r"\b(rtc[A-Z]\w+|RTC[A-Z_]\w+)\b", without_comments(text)
        ):
            yield "names Embree outside core/embree, core/accel and core/bvh"
        if not is_under(path, "renderer/core/bindings") and re.search(r"#include\s*<nanobind|\bnanobind::|\bnb::", text):
            yield "uses nanobind outside core/bindings"
        if re.search(r'#include\s*[<"]pxr/', text):
            yield "the core knows no USD"


def one_place_for_what_is_asked_of_a_stage(path: PurePosixPath, text: str) -> Iterator[str]:
    """Whoever asks by themselves forgets one of the answers: prims below `class`, splines, value clips."""
    if path.suffix != ".py" or not is_under(path, USD):
        return
    used = {node.attr for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Attribute)}
    for place, names in ONE_PLACE.items():
        if str(path) != place and (own := sorted(used & names)):
            yield f"asks {', '.join(own)}: {place} does"


def one_rule_for_no_frame(path: PurePosixPath, text: str) -> Iterator[str]:
    """Without a frame a value is read at its earliest time where it has no default (stage/values.py)."""
    if path.suffix != ".py" or not is_under(path, USD):
        return
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Attribute):
            continue
        of = node.value.attr if isinstance(node.value, ast.Attribute) else getattr(node.value, "id", "")
        if (of, node.attr) == ("when", "time") and str(path) not in TIMES_OF_RENDER:
            yield f"asks when.time in line {node.lineno}: without a frame stage/values.py knows at which time to read"
        if (of, node.attr) == ("TimeCode", "Default") and str(path) not in DEFAULT_TIMES:
            yield f"reads defaults in line {node.lineno}: stage/values.py knows what is read where there is none"


def one_reader_of_shading_networks(path: PurePosixPath, text: str) -> Iterator[str]:
    """authored.py reads each attribute of a network once; materialx/ writes layers, appearance.py reads shapes."""
    folder = f"{USD}/materials"
    if path.suffix != ".py" or not is_under(path, folder) or is_under(path, f"{folder}/materialx"):
        return
    if str(path) not in (f"{folder}/authored.py", f"{folder}/appearance.py") and re.search(r"\.Get(Attribute|Input)\(", text):
        yield f"reads attributes of a shading network: {folder}/authored.py does"


def without_comments(text: str) -> str:
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)


def names_say_something(path: PurePosixPath, text: str) -> Iterator[str]:
    vague = VAGUE_NAMES & {part.lower() for part in (*path.parts[:-1], path.stem)}
    if vague:
        yield f"is called {', '.join(sorted(vague))}, which says nothing"


def files_say_what_they_are(path: PurePosixPath, text: str) -> Iterator[str]:
    starts = {".py": ('"""', "#!"), ".cpp": ("//", "/*"), ".hpp": ("//", "/*"), ".h": ("//", "/*")}[path.suffix]
    if text.strip() and not text.startswith(starts):
        yield "does not open with what it is"


def no_section_banners(path: PurePosixPath, text: str) -> Iterator[str]:
    """A file that needs them is several files."""
    for number, line in enumerate(text.splitlines(), 1):
        if re.match(r"\s*(#|//) ?([-=*])\2{2,}", line):
            yield f"has a section banner in line {number}"


GATES: tuple[Gate, ...] = (
    imports_point_one_way,
    one_gate_per_dependency,
    one_place_for_what_is_asked_of_a_stage,
    one_rule_for_no_frame,
    one_reader_of_shading_networks,
    names_say_something,
    files_say_what_they_are,
    no_section_banners,
)
