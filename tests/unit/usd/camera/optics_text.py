"""Stages of one camera, translated."""

from __future__ import annotations

from pxr import Usd

from primray.description import Camera, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

Codes = list[tuple[str, str]]


def camera_of(body: str, settings: str = "") -> tuple[Camera, Codes]:
    """The camera, and (code, attribute) of what there is to say of it."""
    text = f'def Camera "eye"\n{{\n{body}\n}}\n'
    if settings:
        text += f'def RenderSettings "settings"\n{{\nrel camera = </eye>\n{settings}\n}}\n'
    description, diagnostics = translate(stage_of(text), RenderSettings(camera="/eye"))
    return description.camera, [(d.code, d.attribute) for d in diagnostics if d.prim_path == "/eye"]


def only(body: str, settings: str = "") -> Camera:
    camera, codes = camera_of(body, settings)
    assert codes == []
    return camera


SHUTTER = "double shutter:open = -0.25\ndouble shutter:close = 0.25\n"


EYE = f"""def Xform "rig"
{{
    def Camera "eye"
    {{
        {SHUTTER}
    }}
    def Camera "other"
    {{
        float focalLength.timeSamples = {{ 0: 1, 10: 2 }}
    }}
}}
"""


def moved(prim: str, name: str, start: str, end: str, more: str = "") -> str:
    kind, path = prim.split()
    return f'def {kind} "{path}"\n{{\n{name}.timeSamples = {{ 0: {start}, 10: {end} }}\n{more}\n}}\n'


OPS = 'uniform token[] xformOpOrder = ["xformOp:translate"]'


POINTS = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n"


INSTANCER = 'rel prototypes = </i/p>\nint[] protoIndices = [0]\ndef Sphere "p"\n{\n}\n'


MOVING = {
    "a transform": moved("Sphere s", "double3 xformOp:translate", "(0, 0, 0)", "(1, 0, 0)", OPS),
    "a parent's transform": moved(
        "Xform s", "double3 xformOp:translate", "(0, 0, 0)", "(1, 0, 0)", OPS + '\ndef Sphere "x"\n{\n}'
    ),
    "points": moved(
        "Mesh s", "point3f[] points", "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]", "[(0, 0, 0), (1, 0, 0), (0, 2, 0)]", POINTS
    ),
    "velocities": (
        'def Mesh "s"\n{\n' + POINTS + "point3f[] points.timeSamples = { 5: [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }\n"
        "vector3f[] velocities.timeSamples = { 5: [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }\n}\n"
    ),
    "an instancer's positions": moved("PointInstancer i", "point3f[] positions", "[(0, 0, 0)]", "[(1, 0, 0)]", INSTANCER),
    "an instancer's orientations": moved(
        "PointInstancer i",
        "quath[] orientations",
        "[(1, 0, 0, 0)]",
        "[(0, 1, 0, 0)]",
        "point3f[] positions = [(0, 0, 0)]\n" + INSTANCER,
    ),
    "a radius": moved("Sphere s", "double radius", "1", "2"),
    "a light": moved(
        "DistantLight s", "double3 xformOp:rotateXYZ", "(0, 0, 0)", "(1, 0, 0)", OPS.replace("translate", "rotateXYZ")
    ),
}


def stage_with(text: str) -> Usd.Stage:
    return stage_of(EYE + text)


def exposed(text: str, time: float | None = 5.0) -> SceneDescription:
    """What moves is shown, so nothing is told."""
    found, diagnostics = translate(stage_with(text), RenderSettings(camera="/rig/eye", time_code=time))
    assert "motion" not in [d.code for d in diagnostics]
    return found
