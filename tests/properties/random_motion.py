"""Random stages of what moves: nested transforms at unequal samples, native and point instances, a light, a camera."""

from __future__ import annotations

import random

FRAME = 5.0
OPS = {
    "double3 xformOp:translate": 2.0,
    "double3 xformOp:scale": 0.0,
    "double xformOp:rotateX": 90.0,
    "float xformOp:rotateZ": 150.0,
    "float3 xformOp:rotateXYZ": 60.0,
    "double3 xformOp:translate:pivot": 1.0,
    "!invert!xformOp:translate:pivot": 0.0,
}


def stage_text(seed: int) -> str:
    r = random.Random(seed)
    opens = r.uniform(-0.6, 0.2)
    shutter = f"double shutter:open = {opens}\ndouble shutter:close = {opens + r.uniform(0.2, 0.8)}"
    cube = _prim(r, "Cube", "c", 2, "double size = 0.5")
    nested = _prim(r, "Xform", "a", 2, _prim(r, "Xform", "b", 1, cube))
    kind = f'class "kind"\n{{\n{_prim(r, "Cube", "k", 1, "double size = 0.5")}}}\n'
    instance = _prim(r, "Xform", "n", 2, "", "instanceable = true\nprepend references = </kind>")
    light = _prim(r, "RectLight", "l", 2, "", scales=False)
    camera = _prim(r, "Camera", "cam", 1, shutter, scales=False, turns=3.0)
    return f'{kind}{nested}{instance}{_prim(r, "Xform", "p", 1, _instancer(r))}{light}def Xform "far"\n{{\n' + (
        f'double3 xformOp:translate = (0, 0, 25)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n{camera}}}\n'
    )


def _prim(
    r: random.Random,
    kind: str,
    name: str,
    count: int,
    body: str,
    header: str = "",
    *,
    scales: bool = True,
    turns: float = 180.0,
) -> str:
    """With some operations of random samples; one in three is a motion:blurScale's."""
    usable = [op for op in OPS if not op.startswith("!") and (scales or "scale" not in op)]
    ops = sorted(r.sample(usable, count), key=usable.index)
    lines = "\n".join(f"{op}.timeSamples = {{ {_samples(r, op, turns)} }}" for op in ops)
    order = ", ".join(f'"{op.split()[1]}"' for op in ops)
    blur = ""
    if kind == "Xform" and r.random() < 0.34:
        header += '\nprepend apiSchemas = ["MotionAPI"]'
        blur = f"float motion:blurScale = {r.choice([0.5, 1.5, 2.0])}\n"
    return f'def {kind} "{name}" (\n{header}\n)\n{{\n{blur}{lines}\nuniform token[] xformOpOrder = [{order}]\n{body}\n}}\n'


def _samples(r: random.Random, op: str, turns: float) -> str:
    times = sorted(round(r.uniform(3.5, 6.5), 3) for _ in range(r.randint(2, 5)))
    reach = min(OPS[op], turns)
    low, high = (0.4, 1.6) if "scale" in op else (-reach, reach)

    def one() -> str:
        values = [f"{r.uniform(low, high):.4f}" for _ in range(3 if "3" in op.split()[0] else 1)]
        return f"({', '.join(values)})" if len(values) > 1 else values[0]

    return ", ".join(f"{time}: {one()}" for time in dict.fromkeys(times))


def _instancer(r: random.Random) -> str:
    times = [round(r.uniform(3.5, 4.9), 3), round(r.uniform(5.1, 6.5), 3)]

    def rows(reach: float) -> str:
        found = (f"({', '.join(f'{r.uniform(-reach, reach):.3f}' for _ in range(3))})" for _ in range(4))
        return f"[{', '.join(found)}]"

    def sampled(name: str, reach: float) -> str:
        return f"{name}.timeSamples = {{ {', '.join(f'{time}: {rows(reach)}' for time in times)} }}\n"

    turns = "(1, 0, 0, 0), (0.8, 0.6, 0, 0), (0, 0, 1, 0), (0.6, 0, 0, -0.8)"
    text = sampled("point3f[] positions", 3) + "int[] protoIndices = [0, 0, 0, 0]\nrel prototypes = <q>\n"
    text += f"quatf[] orientationsf.timeSamples = {{ {times[0]}: [{turns}], {times[1]}: [{turns[::1]}] }}\n"
    if r.random() < 0.7:
        text += sampled("vector3f[] velocities", 40)
        text += sampled("vector3f[] accelerations", 400) if r.random() < 0.5 else ""
    text += sampled("vector3f[] angularVelocities", 900) if r.random() < 0.7 else ""
    return f'def PointInstancer "i"\n{{\n{text}def Cube "q"\n{{\ndouble size = 0.5\n}}\n}}\n'
