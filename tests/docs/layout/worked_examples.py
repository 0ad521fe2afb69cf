"""One small example of each thing that ARCHITECTURE.md says how to add, as the edits of files that its list names.

An example is applied to a copy of the tree, where a check says whether what was added is there.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from .architecture import ROOT

NAME = "worked"  # takes the place of NAME in lists


@dataclass(frozen=True)
class Edit:
    """Lines put behind the one place where `after` stands in a file; or a new file, where `after` is None."""

    path: str
    after: str | None
    text: str


@dataclass(frozen=True)
class Example:
    edits: tuple[Edit, ...]
    python: str = ""  # run in the copy; it fails where the example does
    compiled: str = ""  # a source that a compiler must accept in the copy


LIGHT = """// A ring, which the example takes for a disc.
#pragma once

#include "light/types/disk.hpp"

namespace primray {

struct RingLight : DiskLight {
  static constexpr LightType kType = LightType::kRing;
  static constexpr const char* kName = "RING";
};

}  // namespace primray
"""
LOBE = """// Retroreflection at grazing angles, which the example makes as even as Lambert's.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE vfloat<W> sheen_value(vfloat<W> sheen, vfloat<W> cos_in) {
  return sheen * cos_in * kInvPi;
}

}  // namespace primray
"""
ROUTE = """\"\"\"An answer, for the example.\"\"\"

from fastapi import APIRouter, Response

from ..http.answers import json_answer

router = APIRouter(prefix="/v1", tags=["health"])


@router.get("/worked")
async def worked() -> Response:
    return json_answer({"worked": True})
"""
EXECUTOR = """\"\"\"The local executor, by another name.\"\"\"

from .local import local_executor as worked_executor

__all__ = ["worked_executor"]
"""
CORE, PRIMRAY, SERVICE = "renderer/core", "renderer/primray", "service/primray_service"

EXAMPLES: dict[str, Example] = {
    "A light type": Example(
        (
            Edit(f"{CORE}/light/types/{NAME}.hpp", None, LIGHT),
            Edit(
                f"{CORE}/light/types/light_types.hpp",
                '#include "light/types/sphere.hpp"\n',
                '#include "light/types/worked.hpp"\n',
            ),
            Edit(f"{CORE}/light/types/light_types.hpp", "LightTypeList<SphereLight, ", "RingLight, "),
            Edit(f"{CORE}/light/types/light_row.hpp", "kMesh, kLine", ", kRing"),
            Edit(f"{PRIMRAY}/description/lighting.py", '    LINE = "line"\n', '    RING = "ring"\n'),
            Edit(f"{PRIMRAY}/usd/adapters/lights/light.py", '    "DiskLight": _disk,\n', '    "RingLight": _disk,\n'),
            Edit(f"{PRIMRAY}/usd/translate.py", '"DiskLight", ', '"RingLight", '),
        ),
        python="""
            from primray.description import LightType
            from primray.usd.translate import LIGHTS
            assert LightType.RING and LIGHTS["RingLight"]
        """,
        compiled="build/lights/light_rows.cpp",
    ),
    "A lobe": Example(
        (
            Edit(f"{CORE}/bsdf/{NAME}.hpp", None, LOBE),
            Edit(f"{CORE}/bsdf/bsdf.hpp", '#include "bsdf/surface.hpp"\n', '#include "bsdf/worked.hpp"\n'),
            Edit(f"{CORE}/bsdf/bsdf.hpp", "  vbool<W> thin, mirror;\n", "  vfloat<W> sheen;\n"),
            Edit(f"{CORE}/bsdf/bsdf.hpp", "    f0 = color(kF0), f90 = color(kF90);\n", "    sheen = field(kSheen);\n"),
            Edit(
                f"{CORE}/bsdf/bsdf.hpp", "    vvec3<W> g(vfloat<W>(0.0f));\n", "    g = vvec3<W>(sheen_value(sheen, cos_in));\n"
            ),
            Edit(f"{CORE}/bsdf/varying_inputs.hpp", "enum class InputField : int32_t {\n", "  kSheen,\n"),
            Edit(f"{CORE}/bsdf/varying_inputs.hpp", "  Number metallic, ", "sheen, "),
            Edit(
                f"{CORE}/bsdf/varying_inputs.hpp",
                "  constexpr InputRange unit;\n",
                '  f(InputField::kSheen, "sheen", unit, [](auto& v) -> auto& { return v.sheen; });\n',
            ),
            Edit(f"{CORE}/bsdf/surface.hpp", "  kClearcoatF0,\n", "  kSheen,\n"),
            Edit(f"{CORE}/bsdf/surface.hpp", "  row[kClearcoat] = v.clearcoat;\n", "  row[kSheen] = v.sheen;\n"),
            Edit(f"{PRIMRAY}/description/shading.py", "    clearcoat: float = 0.0\n", "    sheen: float = 0.0\n"),
            Edit(
                f"{PRIMRAY}/usd/adapters/materials/material.py",
                '    "clearcoat": _Slot("clearcoat", (0.0,), 0.0, 1.0),\n',
                '    "sheen": _Slot("sheen", (0.0,), 0.0, 1.0),\n',
            ),
        ),
        python="""
            from primray.description import Surface
            from primray.usd.adapters.materials.material import _SLOTS
            assert Surface("").sheen == 0 and _SLOTS["sheen"]
        """,
        compiled="bsdf/bsdf.hpp",
    ),
    "An output": Example(
        (
            Edit(f"{PRIMRAY}/images/image.py", 'VIEW_EXTENSIONS = (".png", ', '".bmp", '),
            Edit(f"{PRIMRAY}/cli/output_flags.py", 'help="EXR, PNG', ", BMP"),
        ),
        python="""
            import numpy, tempfile
            from pathlib import Path
            from primray.images.image import check_output_path
            assert check_output_path(Path(tempfile.mkdtemp(), "picture.bmp"))
        """,
    ),
    "A route": Example(
        (
            Edit(f"{SERVICE}/routes/{NAME}.py", None, ROUTE),
            Edit(f"{SERVICE}/app.py", "from .routes import account", ", worked"),
            Edit(f"{SERVICE}/app.py", "    health.router,\n", "    worked.router,\n"),
        ),
        python="""
            from primray_service.app import ROUTERS, create_routes
            assert create_routes() and any(route.path == "/v1/worked" for router in ROUTERS for route in router.routes)
        """,
    ),
    "An executor": Example(
        (
            Edit(f"{SERVICE}/executor/{NAME}.py", None, EXECUTOR),
            Edit(
                f"{SERVICE}/executor/by_name.py",
                '    "local": "local:local_executor",\n',
                '    "worked": "worked:worked_executor",\n',
            ),
        ),
        python="""
            from primray_service.executor.by_name import check_name, executor_maker
            check_name("worked")
            assert executor_maker("worked") is executor_maker("local")
        """,
    ),
    "A diagnostic": Example(
        (
            Edit(
                f"{PRIMRAY}/diagnostic_codes.py",
                "CODES: dict[str, Code] = {\n",
                '    "worked-example": Code(Severity.INFO, Kind.NOTE, "An example.", "Nothing."),\n',
            ),
            Edit(
                f"{PRIMRAY}/usd/adapters/lights/light.py",
                '    """The light at this matrix; None where it emits nothing, with a diagnostic."""\n',
                '    ctx.warn("worked-example", prim.path, "It is worked.")\n',
            ),
        ),
        python="""
            from pxr import Usd, UsdGeom, UsdLux
            from primray.settings import RenderSettings
            from primray.usd.translate import translate
            stage = Usd.Stage.CreateInMemory()
            UsdLux.SphereLight.Define(stage, "/light"), UsdGeom.Cube.Define(stage, "/cube")
            _, diagnostics = translate(stage, RenderSettings())
            assert "worked-example" in [d.code for d in diagnostics]
        """,
    ),
}


def apply(example: Example, to: Path) -> None:
    """Put the example into a copy of the sources."""
    for folder in ("renderer", "service"):
        shutil.copytree(ROOT / folder, to / folder, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    for edit in example.edits:
        path = to / edit.path
        if edit.after is None:
            assert not path.exists(), f"{edit.path} is not new"
            path.write_text(edit.text, encoding="utf-8")
            continue
        text = path.read_text(encoding="utf-8")
        assert text.count(edit.after) == 1, f"{edit.path} has {text.count(edit.after)} places like {edit.after!r}"
        path.write_text(text.replace(edit.after, edit.after + edit.text), encoding="utf-8")


def run_python(source: str, tree: Path) -> None:
    """Raises CalledProcessError if it fails."""
    first = f"import sys; sys.path[:0] = {[str(tree / 'renderer'), str(tree / 'service')]}; sys.meta_path[:] = [f for f in "
    first += "sys.meta_path if not type(f).__module__.startswith('_editable')]\n"
    lines = "\n".join(line.strip() for line in source.strip().splitlines())
    subprocess.run([sys.executable, "-c", first + lines], cwd=tree, check=True)


def run_compiler(compiler: str, source: str, tree: Path) -> None:
    """Raises CalledProcessError if it does not accept the source, whose errors it has told."""
    core = tree / "renderer" / "core"
    flags = ["-std=c++20", "-fsyntax-only", "-march=x86-64-v3", "-w", "-x", "c++", f"-I{core}"]
    flags += ['-DPRIMRAY_ISA="v3"', "-DPRIMRAY_MAX_LANES=8"]
    subprocess.run([compiler, *flags, str(core / source)], check=True)
