"""One small example of each thing that ARCHITECTURE.md says how to add, as the edits of files that its list names.

An example is applied to a copy of the tree, where a check says whether what was added is there.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
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
    compiled: tuple[str, ...] = ()  # sources that a compiler must accept in the copy


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
ADAPTER = """\"\"\"Balls, for the example.\"\"\"

from ....description import Ball, Shape
from ...resolving.context import Context
from ...resolving.resolve import ResolvedPrim


def ball(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    return Ball(prim.path, 1.0, 0)
"""
SHAPE = """

@dataclass(frozen=True, slots=True)
class Ball(Sphere):
    pass
"""
CURVED = """// A ball, which the example takes for a sphere.
#pragma once

#include "scene/curved/sphere.hpp"

namespace primray {

struct BallShape : SphereShape {
  static constexpr uint32_t kGeometry = 4;
  static OwnedGeometry geometry(const Record* records, uint32_t count);
};

}  // namespace primray
"""
GEOMETRY = """// A ball's geometry, for the example.
#include "scene/curved/worked.hpp"

namespace primray {

OwnedGeometry BallShape::geometry(const Record* records, uint32_t count) { return SphereShape::geometry(records, count); }

}  // namespace primray
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
        compiled=("build/lights/light_rows.cpp",),
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
            Edit(f"{CORE}/bsdf/basics/varying_inputs.hpp", "enum class InputField : int32_t {\n", "  kSheen,\n"),
            Edit(f"{CORE}/bsdf/basics/varying_inputs.hpp", "  Number metallic, ", "sheen, "),
            Edit(
                f"{CORE}/bsdf/basics/varying_inputs.hpp",
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
        compiled=("bsdf/bsdf.hpp",),
    ),
    "A prim type": Example(
        (
            Edit(f"{PRIMRAY}/usd/adapters/shapes/{NAME}.py", None, ADAPTER),
            Edit(f"{PRIMRAY}/usd/translate.py", "import POINT, point_sphere\n", "from .adapters.shapes.worked import ball\n"),
            Edit(f"{PRIMRAY}/usd/translate.py", '    "Sphere": sphere,\n', '    "Ball": ball,\n'),
            Edit(f"{PRIMRAY}/description/geometry.py", "    return low.astype(np.float64), high.astype(np.float64)\n", SHAPE),
            Edit(
                f"{PRIMRAY}/description/geometry.py",
                "Shape = Mesh | SubdivisionMesh | DisplacedMesh | NurbsPatch | Sphere",
                " | Ball",
            ),
            Edit(f"{PRIMRAY}/description/__init__.py", "from .geometry import (\n", "    Ball,\n"),
            Edit(f"{PRIMRAY}/description/__init__.py", '    "AovRequest",\n', '    "Ball",\n'),
            Edit(f"{PRIMRAY}/core/shape_upload.py", "from ..description import ", "Ball, "),
            Edit(
                f"{PRIMRAY}/core/shape_upload.py",
                "{Sphere: add_sphere",
                ", Ball: lambda to, ball, m: to.add_ball(ball.radius, ball.surface, m)",
            ),
            Edit(f"{CORE}/scene/curved/{NAME}.hpp", None, CURVED),
            Edit(
                f"{CORE}/scene/curved/curved_shapes.hpp",
                '#include "scene/curved/sphere.hpp"\n',
                '#include "scene/curved/worked.hpp"\n',
            ),
            Edit(f"{CORE}/scene/curved/curved_shapes.hpp", "CurvedKindList<SphereShape", ", BallShape"),
            Edit(f"{CORE}/accel/{NAME}_geometry.cpp", None, GEOMETRY),
            Edit(
                f"{CORE}/bindings/shape_bindings.cpp",
                "  builder\n",
                '      .def("add_ball", [](SceneBuilder& b, double radius, int surface, InArray<double> matrix) {\n'
                "        return b.add_curved<BallShape>(radius, surface, affine_of(matrix));\n      })\n",
            ),
        ),
        python="""
            from pxr import Usd
            from primray.core.shape_upload import CURVED
            from primray.description import Ball
            from primray.settings import RenderSettings
            from primray.usd.translate import translate
            stage = Usd.Stage.CreateInMemory()
            stage.DefinePrim("/ball", "Ball")
            description, _ = translate(stage, RenderSettings())
            assert [type(shape) for shape in description.shapes] == [Ball] and Ball in CURVED
        """,
        compiled=("accel/worked_geometry.cpp", "accel/build.cpp", "bindings/shape_bindings.cpp"),
    ),
    "An AOV": Example(
        (
            Edit(
                f"{PRIMRAY}/aov_names.py",
                "AOVS: dict[str, AovKind] = {\n",
                '    "facing": AovKind(("",), "cosine between the normal and the view"),\n',
            ),
            Edit(
                f"{PRIMRAY}/usd/adapters/rendering/render_var.py",
                "COMMON: dict[str, tuple[str, ...]] = {\n",
                '    "facing": ("facingRatio",),\n',
            ),
            Edit(f"{CORE}/aov/first_hit.hpp", "  std::vector<float> depth, distance", ", facing"),
            Edit(f"{CORE}/aov/first_hit.hpp", "return !(depth.empty()", " && facing.empty()"),
            Edit(
                f"{CORE}/aov/first_hit_task.hpp",
                "      put(planes_.normal, p, ns, i), put(planes_.geometric, p, ng, i);\n",
                "      if (!planes_.facing.empty()) planes_.facing[p] = -dot(ns, ray.d)[i];\n",
            ),
            Edit(
                f"{CORE}/bindings/first_hit_bindings.cpp",
                '    if (name == "depth") p.depth.resize(pixels);\n',
                '    if (name == "facing") p.facing.resize(pixels);\n',
            ),
            Edit(f"{CORE}/bindings/first_hit_bindings.cpp", '  add("depth", p.depth, 1),', ' add("facing", p.facing, 1),'),
        ),
        python="""
            from primray.aov_names import requests_of
            from primray.usd.adapters.rendering.render_var import NAMES
            assert requests_of(["facing"]) and NAMES["facingRatio"] == "facing"
        """,
        compiled=("aov/first_hit.cpp", "bindings/first_hit_bindings.cpp"),
    ),
    "An output": Example(
        (
            Edit(f"{PRIMRAY}/description/picture_file.py", 'OTHER_EXTENSIONS = (".hdr", ', '".bmp", '),
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


def _nanobind() -> str:
    command = [sys.executable, "-m", "nanobind", "--include_dir"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def run_compiler(compiler: str, source: str, tree: Path) -> None:
    """Raises CalledProcessError if it does not accept the source, whose errors it has told."""
    core, headers = tree / "renderer" / "core", [sysconfig.get_path("include"), _nanobind()]
    flags = ["-std=c++20", "-fsyntax-only", "-march=x86-64-v3", "-w", "-x", "c++", f"-I{core}"]
    flags += ['-DPRIMRAY_ISA="v3"', "-DPRIMRAY_MAX_LANES=8", *(f"-I{folder}" for folder in headers)]
    subprocess.run([compiler, *flags, str(core / source)], check=True)
