"""Every stage of scenes/ still gives the same pixels: `python -m tests.pixels` compares with pixels.json.

A guard for changes of layout; it goes when they are done. `--record` writes the table. A row is a stage and a build of the
core, as "isa/lanes"; rows of classes that this CPU lacks stay as they are and are not compared.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_name("pixels.json")
BUILDS = {"v2": (4,), "v3": (1, 4, 8), "v4": (16,)}
WIDTH, SAMPLES = 96, 16


def stages() -> list[Path]:
    """Those that are rendered by themselves: a folder's own stage, not the layers it refers to."""
    return sorted(
        path
        for path in (ROOT / "scenes").rglob("*.usda")
        if path.parent.parent.parent == ROOT / "scenes" or path.parent.parent == ROOT / "scenes"
    )


def hashes() -> dict[str, str]:
    """By stage, with the core that this process is asked to use."""
    import primray

    found = {}
    for path in stages():
        settings = primray.RenderSettings(spp=SAMPLES, resolution=(WIDTH, 0))
        found[path.relative_to(ROOT / "scenes").as_posix()] = primray.render(path, settings).report["pixels_sha256"]
    return found


def measure(isas: list[str]) -> dict[str, dict[str, str]]:
    """By build, each in a process of its own."""
    measured = {}
    for isa in isas:
        for lanes in BUILDS[isa]:
            environment = os.environ | {"PRIMRAY_ISA": isa, "PRIMRAY_LANES": str(lanes)}
            command = [sys.executable, "-m", "tests.pixels", "--print"]
            done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
            if done.returncode:
                print(f"{isa}/{lanes}: not compared: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
                continue
            measured[f"{isa}/{lanes}"] = json.loads(done.stdout)
    return measured


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--print", action="store_true")
    parser.add_argument("--isa", action="append", choices=list(BUILDS))
    asked = parser.parse_args()
    if asked.print:
        print(json.dumps(hashes()))
        return 0
    measured = measure(asked.isa or list(BUILDS))
    recorded = json.loads(TABLE.read_text(encoding="utf-8")) if TABLE.exists() else {}
    if asked.record:
        TABLE.write_text(json.dumps(recorded | measured, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        return 0
    differ = [
        f"{build} {stage}: {found} where {recorded[build].get(stage)} was recorded"
        for build, rows in measured.items()
        for stage, found in rows.items()
        if recorded[build].get(stage) != found
    ]
    print("\n".join(differ) or f"the same pixels: {sum(map(len, measured.values()))} pictures by {', '.join(measured)}")
    return bool(differ) or not measured


if __name__ == "__main__":
    sys.exit(main())
