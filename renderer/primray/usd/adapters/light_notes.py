"""What a light asks for and does not get, as diagnostics: shadows, filters, linking, other shaders."""

from __future__ import annotations

from pxr import Usd

from ..context import Context
from ..read import read
from ..resolve import ResolvedPrim

# UsdLux ShadowAPI: attribute -> the value that changes nothing.
_NEUTRAL: dict[str, object] = {
    "inputs:shadow:enable": True,
    "inputs:shadow:color": (0.0, 0.0, 0.0),
    "inputs:shadow:distance": -1.0,
}


def note_ignored_inputs(prim: ResolvedPrim, ctx: Context) -> None:
    ignored = [f"{name} = {raw}" for name, raw in _authored(prim, ctx) if _matters(name, raw)]
    if ignored:
        ctx.warn("light-input", prim.path, f"Ignored: {', '.join(sorted(ignored))}.")
    if "light:filters" in prim.names and prim.prim.GetRelationship("light:filters").GetTargets():
        ctx.warn("light-input", prim.path, "Light filters are ignored.", "light:filters")
    _note_shader(prim, ctx)
    _note_linking(prim.prim, prim, ctx)


def _note_shader(prim: ResolvedPrim, ctx: Context) -> None:
    """light:shaderId is the schema's own for every light that is rendered; nothing stands for others."""
    if "light:shaderId" not in prim.names:
        return
    shader = read(prim.prim, "light:shaderId", ctx.when)
    own = {prim.type_name, prim.type_name.removesuffix("_1"), "MeshLight", ""}
    if shader not in own:
        message = f"light:shaderId = {shader!r} is ignored: it is rendered as its type says."
        ctx.warn("light-input", prim.path, message, "light:shaderId")


def _authored(prim: ResolvedPrim, ctx: Context) -> list[tuple[str, object]]:
    wanted = [n for n in prim.names if n in _NEUTRAL]
    return [(name, read(prim.prim, name, ctx.when)) for name in wanted]


def _matters(name: str, raw: object) -> bool:
    neutral = _NEUTRAL.get(name)
    if raw is None or neutral is None:
        return False
    if isinstance(neutral, tuple):
        return tuple(raw) != neutral  # type: ignore[arg-type]
    if name == "inputs:shadow:distance":
        return isinstance(raw, int | float) and raw >= 0
    return bool(raw != neutral)


def _note_linking(light: Usd.Prim, prim: ResolvedPrim, ctx: Context) -> None:
    """Light and shadow linking: a collection that leaves something out (the default includes everything)."""
    for name in ("lightLink", "shadowLink"):
        collection = Usd.CollectionAPI(light, name)
        authored = [n for n in prim.names if n.startswith(f"collection:{name}:")]
        if not authored:
            continue
        root = collection.GetIncludeRootAttr().Get()
        excludes = collection.GetExcludesRel().HasAuthoredTargets()
        expression = any(n.endswith("membershipExpression") for n in authored)
        if not root or excludes or expression:
            ctx.warn("light-input", prim.path, f"{name} is ignored: the light reaches everything.")
