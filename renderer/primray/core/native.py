"""The compiled core: choice of the module by the CPU, its settings and errors. Only this imports `_core_*`.

Modules exist for x86-64 v2, v3 and v4. The environment variables `PRIMRAY_ISA` (v2, v3, v4) and `PRIMRAY_LANES` (1, 4, 8, 16)
override the choice; `PRIMRAY_CORES` names a folder with another build's modules, such as those of `make debug`.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import re
import sys
from functools import cache
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from .. import errors
from ..installed_packages import library_of, version_of
from ..settings import RenderSettings
from ..time_spans import is_recording

# CPU flags that each class requires, as Linux names them (x86-64 psABI, section 3.1.1); newest class first.
ISA_FLAGS = {
    "v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "v3": {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"},
    "v2": {"cx16", "lahf_lm", "popcnt", "sse4_1", "sse4_2", "ssse3"},
}
DEFAULT_LANES = {"v4": 16, "v3": 8, "v2": 4}


def _cpu_flags() -> set[str]:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("flags"):
            return set(line.split(":", 1)[1].split())
    return set()


def runnable_isas() -> list[str]:
    """Return the ISA classes that this CPU supports, newest first."""
    flags, runnable = _cpu_flags(), list[str]()
    for name in reversed(ISA_FLAGS):  # each class includes all older ones
        if not ISA_FLAGS[name] <= flags:
            break
        runnable.insert(0, name)
    return runnable


@cache
def isa() -> str:
    """Return the ISA class in use: the newest that the CPU supports, unless PRIMRAY_ISA names one."""
    runnable = runnable_isas()
    wanted = os.environ.get("PRIMRAY_ISA")
    if wanted is None:
        if not runnable:
            raise errors.UnsupportedError("this CPU lacks SSE4.2 (x86-64-v2), which primray requires", code="cpu")
        return runnable[0]
    if wanted not in ISA_FLAGS:
        raise errors.SettingsError(f"PRIMRAY_ISA must be v2, v3 or v4, not {wanted!r}")
    if wanted not in runnable:
        raise errors.SettingsError(f"PRIMRAY_ISA={wanted}, but this CPU supports {', '.join(runnable)}")
    return wanted


@cache
def lanes() -> int:
    """Return how many paths the kernel traces at a time (SIMD lanes)."""
    wanted = os.environ.get("PRIMRAY_LANES")
    if wanted is None:
        return DEFAULT_LANES[isa()]
    if not wanted.isdigit() or not module().has_lanes(int(wanted)):
        raise errors.SettingsError(
            f"PRIMRAY_LANES must be 1, 4, 8 or 16, at most {module().MAX_LANES} in the {isa()} build, not {wanted!r}"
        )
    return int(wanted)


def _embree_path() -> Path:
    found = library_of("embreex", "libembree4")
    if found is None:
        raise errors.InternalError("the embreex package carries no Embree library for this platform", code="embree")
    return found


@cache
def module() -> ModuleType:
    """Return the extension module for `isa()`, with Embree loaded."""
    return load(isa())


def load(isa: str) -> ModuleType:
    """Return the extension module for an ISA class, with Embree loaded."""
    name = f"primray._core_{isa}"
    try:
        core = _imported(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise errors.SettingsError(
            f"this build of primray has no {isa} core; `make cores` in its source tree compiles those that this CPU supports"
        ) from error
    core.load_embree(str(_embree_path()))
    core.record_spans(is_recording())
    return core


def loaded() -> list[ModuleType]:
    """Return the extension modules that this process has loaded."""
    return [module for name, module in list(sys.modules.items()) if re.fullmatch(r"primray\._core_v\d", name)]


def _imported(name: str) -> ModuleType:
    """Import an extension module of the installed package, or of the build that PRIMRAY_CORES names."""
    folder = os.environ.get("PRIMRAY_CORES")
    if folder is None or name in sys.modules:
        return importlib.import_module(name)
    spec = PathFinder.find_spec(name, [folder])
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"PRIMRAY_CORES={folder} has no {name}", name=name)
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def is_outdated() -> bool:
    """Return whether a module that is loaded is older than the core's sources, where these are beside the package."""
    sources = Path(__file__).resolve().parents[2] / "core"
    modules = loaded()
    if not modules or not sources.is_dir():
        return False
    newest = max((file.stat().st_mtime for file in sources.rglob("*.[ch]pp")), default=0.0)
    return any(Path(str(module.__file__)).stat().st_mtime < newest for module in modules)


@cache
def build_digest() -> str:
    """Return a digest of the module's file: two builds need not agree in every bit."""
    return hashlib.sha256(Path(str(module().__file__)).read_bytes()).hexdigest()[:16]


def versions() -> dict[str, str]:
    """Return the versions of Embree and of the package that carries it."""
    return {"embree": "4.4.0", "embreex": str(version_of("embreex"))}


NO_DEPTH_LIMIT = 1 << 20


def threads(settings: RenderSettings) -> int:
    return settings.threads or len(os.sched_getaffinity(0))


def max_depth(settings: RenderSettings) -> int:
    return NO_DEPTH_LIMIT if settings.max_depth is None else settings.max_depth


def unexpected(error: Exception, hint: str) -> errors.InternalError:
    """Return the error to report for an exception that nobody expected, with a hint; a core that is older than its sources is
    the likeliest cause."""
    if is_outdated():
        message = (
            "the compiled core is older than its sources, and they do not fit together: run `make setup`, which compiles it"
        )
        return errors.InternalError(f"{message} ({type(error).__name__}: {error})", code="core-outdated")
    return errors.InternalError(f"{type(error).__name__}: {error} ({hint})")


def raise_primray_error(error: Exception) -> NoReturn:
    """Raise the PrimrayError that corresponds to a CoreError."""
    code, message = error.args
    if code in ("out-of-memory", "too-large"):
        raise errors.LimitError(message, code=code) from error
    if code == "settings-error":
        raise errors.SettingsError(message) from error
    raise errors.InternalError(message, code=code) from error
