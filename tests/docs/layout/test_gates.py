"""The layout's rules hold for every source file, and each of them can fail."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pytest

from .gates import GATES

ROOT = Path(__file__).resolve().parents[3]
SUFFIXES = (".py", ".cpp", ".hpp", ".h")
SOURCES = [
    PurePosixPath(path.relative_to(ROOT).as_posix())
    for folder in ("renderer", "service", "tests")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in SUFFIXES and "__pycache__" not in path.parts
]


@pytest.mark.parametrize("gate", GATES, ids=lambda gate: gate.__name__)
def test_gate(gate):
    broken = [f"{path} {why}" for path in SOURCES for why in gate(path, (ROOT / path).read_text(encoding="utf-8"))]
    assert not broken, "\n".join(broken)


def test_the_sources_are_found():
    assert PurePosixPath("renderer/primray/render/render.py") in SOURCES


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("renderer/primray/render/render.py", "from pxr import Usd\n"),
        ("renderer/primray/cli/commands/render.py", "def f():\n    import pxr.Usd\n"),
        ("renderer/primray/usd/translate.py", "from .. import core\n"),
        ("renderer/primray/usd/mesh/adapter.py", "from ... import core\n"),
        ("renderer/primray/usd/translate.py", "from primray.core import build\n"),
        ("renderer/primray/usd/translate.py", "from .._core_v3 import build\n"),
        ("renderer/primray/render/render.py", "from .. import _core_v3\n"),
        ("renderer/primray/render/render.py", "import primray_service\n"),
        ("service/primray_service/worker.py", "from starlette.applications import Starlette\n"),
        ("service/primray_service/scenes/shared.py", "from fsspec.core import url_to_fs\n"),
        ("service/primray_service/app.py", "import uvicorn\n"),
        ("renderer/primray/volumes/vdb_file.py", "def f():\n    import blosc\n"),
        ("service/primray_service/routes.py", "import sqlalchemy\n"),
        ("service/primray_service/executor/ray/executor.py", "def f():\n    import ray\n"),
        ("renderer/primray/usd/scene/walk.py", "def f(stage):\n    return list(stage.Traverse())\n"),
        ("renderer/primray/usd/lights/light.py", "from pxr import Usd\nprims = Usd.PrimRange(root)\n"),
        ("renderer/primray/usd/stage/time_varying.py", "def f(prim):\n    return prim.GetChildren()\n"),
        ("renderer/primray/usd/viewing/motion.py", "def f(a):\n    return a.GetNumTimeSamples() > 0\n"),
        ("renderer/primray/usd/stage/traversal.py", "def f(a):\n    return a.HasSpline()\n"),
        ("renderer/primray/usd/stage/values.py", "def f(attribute):\n    return attribute.Get()\n"),
        ("renderer/primray/usd/lights/light.py", "def f(rel):\n    return rel.GetForwardedTargets()\n"),
        ("renderer/primray/usd/scene/inheritance.py", "def f(op, time):\n    return op.GetOpTransform(time)\n"),
        ("renderer/primray/usd/camera/back_plates.py", "def f(camera, when):\n    return camera.GetCamera(when.time)\n"),
        ("renderer/primray/usd/lights/light_links.py", "def f(ctx):\n    return XformCache(ctx.when.time)\n"),
        ("renderer/primray/usd/inspect/prim_identity.py", "from pxr import Usd\ntime = Usd.TimeCode.Default()\n"),
        ("renderer/primray/usd/camera/view.py", "from pxr import UsdGeom\naxis = UsdGeom.GetStageUpAxis(stage)\n"),
        ("renderer/primray/usd/stage/reads.py", "def f(layer):\n    return layer.timeCodesPerSecond\n"),
        ("renderer/primray/usd/materials/mdl/inputs.py", "def f(shader, name):\n    return shader.prim.GetAttribute(name)\n"),
        ("renderer/core/film/film.cpp", "// film\nrtcIntersect1(scene, &ray);\n"),
        ("renderer/core/film/film.cpp", "// film\nRTCScene scene;\n"),
        ("renderer/core/film/film.cpp", "// film\n#include <nanobind/nanobind.h>\n"),
        ("renderer/core/film/film.cpp", '// film\n#include "pxr/usd/stage.h"\n'),
        ("renderer/primray/utils.py", '"""Things."""\n'),
        ("renderer/core/common/math.hpp", "// maths\n"),
        ("renderer/core/film/film.cpp", "#pragma once\n"),
        ("renderer/primray/film.py", "import os\n"),
        ("renderer/primray/images/image.py", "# ---- writing ----\n"),
        ("renderer/core/film/film.cpp", "// film\n// ====\n"),
    ],
)
def test_each_rule_can_fail(path, text):
    if not path.endswith(("film.py", "film.cpp")) and path.endswith(".py") and not text.startswith('"""'):
        text = f'"""A file."""\n{text}'
    assert [why for gate in GATES for why in gate(PurePosixPath(path), text)]


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("renderer/primray/usd/stage/open.py", '"""Stage."""\nfrom pxr import Usd\nfrom ..errors import SceneError\n'),
        ("renderer/primray/usd/stage/traversal.py", '"""Prims."""\ndef f(stage):\n    return stage.Traverse()\n'),
        ("renderer/primray/usd/stage/time_varying.py", '"""Times."""\ndef f(a):\n    return a.HasSpline()\n'),
        ("renderer/primray/usd/stage/reads.py", '"""Guarded."""\ndef f(a):\n    return a.Get()\n'),
        ("renderer/primray/usd/stage/values.py", '"""Values."""\ndef f(a, when):\n    return value_at(a, when.time)\n'),
        ("renderer/primray/volumes/vdb_values.py", '"""Values."""\nimport blosc\n'),
        ("renderer/primray/usd/materials/authored.py", '"""Read."""\ndef f(prim):\n    return prim.GetAttribute("a")\n'),
        ("renderer/primray/core/native.py", '"""The core."""\nfrom .. import _core_v3\n'),
        ("renderer/core/embree/embree.cpp", "// Embree\nrtcNewDevice(nullptr);\n"),
        ("renderer/core/film/film.cpp", "// as rtcIntersect1 does\n"),
        ("service/primray_service/worker.py", '"""Worker."""\nimport primray\n'),
        ("service/primray_service/executor/ray/node/tasks.py", '"""Tasks."""\nimport ray\n'),
    ],
)
def test_what_is_allowed_passes(path, text):
    assert not [why for gate in GATES for why in gate(PurePosixPath(path), text)]
