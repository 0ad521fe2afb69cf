"""Diagnostics: whatever a stage asks for that is ignored, approximated, defaulted or missing, with its code and prim path.

`CODES` is the one table of codes; the documentation's list of what is and isn't supported is generated from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

from .errors import UnsupportedError
from .fidelity import FIDELITY, Kind


class Severity(Enum):
    INFO = "info"  # defaulted or chosen by us; the picture is what the stage says
    WARNING = "warning"  # approximated or ignored; the picture may differ from what the stage says
    ERROR = "error"  # a part is missing from the picture


@dataclass(frozen=True)
class Diagnostic:
    severity: Severity
    code: str
    prim_path: str
    message: str
    attribute: str = ""  # the attribute or relationship in question, as the schema names it; "": the prim as a whole

    @property
    def kind(self) -> Kind:
        return FIDELITY[self.code].kind

    @property
    def is_strict(self) -> bool:
        """Whether `--strict` refuses the stage for it: a warning or error that leaves the picture other than authored."""
        return self.severity is not Severity.INFO and self.kind.changes_picture

    def as_json(self) -> dict[str, str]:
        return {
            "severity": self.severity.value,
            "kind": self.kind.value,
            "code": self.code,
            "prim_path": self.prim_path,
            "attribute": self.attribute,
            "message": self.message,
        }


@dataclass(frozen=True)
class Code:
    severity: Severity
    meaning: str


# code -> severity and what it means; add a row here before using a new code.
CODES: dict[str, Code] = {
    "composition-error": Code(
        Severity.ERROR, "A layer, reference or payload could not be composed; what it would bring is missing."
    ),
    "usd-message": Code(Severity.WARNING, "USD itself complained while it opened or read the stage."),
    "time-metadata": Code(
        Severity.WARNING, "A layer's timeCodesPerSecond (or framesPerSecond) is no usable rate; nothing is sampled by it."
    ),
    "stage-metadata": Code(Severity.WARNING, "Metadata of the stage that is no usable value: USD's default is used."),
    "layer-units": Code(
        Severity.INFO, "A layer's metersPerUnit or upAxis is not the stage's; USD does not convert, and neither does this."
    ),
    "payloads-unloaded": Code(Severity.INFO, "Payloads that were not asked for are not loaded; what they hold is missing."),
    "unsupported-prim": Code(Severity.ERROR, "Geometry of a kind that is not rendered: it is missing from the picture."),
    "unknown-prim-type": Code(
        Severity.WARNING, "A prim type that no loaded schema defines: the prim is ignored, its children are rendered."
    ),
    "api-schema": Code(Severity.WARNING, "An applied schema that could change the picture is ignored."),
    "skinning": Code(Severity.WARNING, "Skeletal deformation is ignored: the undeformed pose is rendered."),
    "posed": Code(Severity.INFO, "Meshes bound to a skeleton are posed by USD's own skinning."),
    "points": Code(Severity.INFO, "Points are rendered as spheres of their widths."),
    "draw-mode": Code(Severity.INFO, "model:drawMode: cards, bounds or axes are drawn in place of the geometry."),
    "draw-mode-input": Code(Severity.WARNING, "Something that a draw mode needs (bounds, a texture) is missing or ignored."),
    "motion": Code(
        Severity.WARNING,
        "Motion while the shutter is open, or by velocities, is ignored: the scene is rendered at one instant.",
    ),
    "color-space": Code(Severity.WARNING, "A colour space is authored and ignored: values are taken as linear Rec.709."),
    "wrong-type": Code(
        Severity.WARNING, "An attribute holds a value of the wrong type, or one that is not finite: its default is used."
    ),
    "out-of-range": Code(Severity.WARNING, "A value outside what its schema allows: the nearest allowed value is used."),
    "invalid-mesh": Code(Severity.ERROR, "A mesh whose topology cannot be used: it is missing from the picture."),
    "faces-dropped": Code(
        Severity.ERROR,
        "Faces with invalid indices, too few vertices or points that are not finite (or beyond 1e37) are missing.",
    ),
    "shape-input": Code(Severity.WARNING, "An attribute of a shape is ignored."),
    "faces-degenerate": Code(Severity.INFO, "Faces without area were left out; the picture is the same without them."),
    "invalid-primvar": Code(Severity.WARNING, "A primvar or normals with the wrong number of values or bad indices: ignored."),
    "subdivision-data": Code(
        Severity.WARNING, "Creases, corners or rules of a subdivision cage that do not fit it: ignored, or a default is used."
    ),
    "cage-topology": Code(
        Severity.WARNING, "A subdivision cage that is not a surface with two sides everywhere: the edges in question are sharp."
    ),
    "dicing-limited": Code(Severity.WARNING, "Subdivision surfaces are coarser than asked for: a limit was reached."),
    "tessellated": Code(Severity.INFO, "An implicit shape is rendered as a fine mesh."),
    "subset-ignored": Code(
        Severity.WARNING,
        "A geometry subset that binds a material holds no faces of its mesh, or its indices are bad: ignored.",
    ),
    "subset-overlap": Code(Severity.WARNING, "Faces are in several subsets with materials: the last one's is used."),
    "subset-incomplete": Code(
        Severity.INFO, "Subsets that are said to hold every face leave some out: those keep the mesh's own material."
    ),
    "primvar-missing": Code(Severity.INFO, "A material reads a primvar that a shape lacks: the reader's fallback is used."),
    "instance-primvar": Code(Severity.WARNING, "A primvar of an instancer does not fit its instances: ignored."),
    "invalid-instancer": Code(
        Severity.ERROR, "Instances that cannot be placed are missing: bad arrays, indices or prototypes."
    ),
    "instances-coincident": Code(
        Severity.INFO, "Instances that stand exactly where others of the same prototype do are left out; nothing is missing."
    ),
    "invalid-transform": Code(Severity.ERROR, "What stands at a transform that is not finite is missing."),
    "reset-xform-in-prototype": Code(
        Severity.WARNING, "resetXformStack inside a prototype resets to the prototype, not to the world."
    ),
    "unsupported-light": Code(Severity.ERROR, "A light of a kind that is not supported: its light is missing."),
    "light-input": Code(
        Severity.WARNING, "An input of a light, or an applied light schema, is ignored or brought into its range."
    ),
    "old-attribute": Code(
        Severity.WARNING, "An attribute of a light by the name it had before USD 21.02, without inputs: ignored, as USD does."
    ),
    "light-dark": Code(
        Severity.WARNING, "A light without size and normalize, or that its transform leaves none, emits nothing by its formula."
    ),
    "instanced-lights": Code(Severity.WARNING, "Too many instances of a light: only the first ones are lit."),
    "asset-missing": Code(Severity.ERROR, "A file that the stage names cannot be found; its constant value is used instead."),
    "texture-unset": Code(Severity.INFO, "A texture node names no file: its fallback is used, as UsdUVTexture says."),
    "shader-ignored": Code(Severity.WARNING, "A shader that is not understood: a stand-in is used."),
    "shader-connection": Code(
        Severity.WARNING, "A connection that leads nowhere, in a circle or to several places: what it stands over is used."
    ),
    "shader-parameter": Code(Severity.WARNING, "A shader's parameter has no known meaning: its default is used."),
    "connection-type": Code(
        Severity.WARNING, "A shader's output does not fit the input it feeds: some of it or a default is used."
    ),
    "material-input": Code(Severity.WARNING, "An input of a material cannot be read: its default is used."),
    "unknown-input": Code(Severity.INFO, "A shader or light has inputs that are no part of its definition: they mean nothing."),
    "other-renderer": Code(Severity.INFO, "Attributes in the namespace of another renderer: they mean nothing here."),
    "displacement": Code(Severity.WARNING, "Displacement is not supported: the surface is rendered undisplaced."),
    "binding-missing": Code(Severity.WARNING, "A material binding leads to no material: it counts as none."),
    "binding-expression": Code(
        Severity.WARNING, "A collection's expression binds what is inside too many instances: each is bound as a whole."
    ),
    "camera-chosen": Code(Severity.INFO, "No camera was asked for: the stage's first one is used."),
    "camera-automatic": Code(Severity.INFO, "The stage has no camera: the one usdrecord would frame is used."),
    "camera-scaled": Code(Severity.WARNING, "A camera's transform has scale or shear, which is removed."),
    "camera-input": Code(Severity.WARNING, "An attribute of the camera is ignored or out of range."),
    "product-chosen": Code(Severity.INFO, "No product was asked for: the first of the RenderSettings' is rendered."),
    "render-settings-input": Code(Severity.WARNING, "Something in RenderSettings, its products or passes is ignored."),
    "render-var": Code(Severity.WARNING, "A render variable cannot be had, or not as it asks: it is left out, or fitted."),
    "aov-empty": Code(Severity.INFO, "An output beside the picture (AOV) reads a primvar that nothing has: it is 0."),
    "aovs-not-merged": Code(
        Severity.WARNING, "Checkpoints hold no AOVs: what is merged of them is the picture alone. Render once for the AOVs."
    ),
    "default-light": Code(
        Severity.INFO,
        "The stage has no light and nothing that emits: a white dome and a key light are added.",
    ),
    "singular-transform": Code(Severity.ERROR, "Instances or spheres whose matrix has no inverse (a scale of 0) are missing."),
    "too-far": Code(
        Severity.ERROR, "Geometry too large or too far away for floats (1e18 times the rest of the scene) is missing."
    ),
    "far-edges": Code(
        Severity.WARNING, "Triangles reach so far beyond what is usual in the scene that floats blur their edges."
    ),
    "emitters-unsampled": Code(Severity.INFO, "More than 262,144 instances emit: beyond, rays find them by chance (noise)."),
    "invalid-samples": Code(Severity.WARNING, "Samples that came out infinite or not a number are left out of the picture."),
    "checkpoint-unwritten": Code(
        Severity.WARNING, "A checkpoint could not be written; the one before it, if there was one, is still there."
    ),
    "samples-missing": Code(Severity.WARNING, "The parts that were merged leave samples out; the picture lacks them."),
    "texture-bad-texels": Code(
        Severity.WARNING,
        "Texels that are not finite, or negative in a light's texture, are read as 0; a light's above 1e15 as that.",
    ),
    "texture-outside": Code(
        Severity.INFO, "All of a surface's texture coordinates lie outside 0 to 1, where its texture's wraps are black."
    ),
    "texture-turned": Code(
        Severity.INFO, "A texture's file asks viewers to show it turned (EXIF): texture coordinates know it as it is stored."
    ),
    "texture-unreadable": Code(
        Severity.ERROR,
        "A texture cannot be read, or is too large: its fallback is used, and a light with such a texture is left out.",
    ),
}


class Diagnostics:
    """An ordered collection of diagnostics; a code repeated on one prim with the same message is kept once."""

    def __init__(self) -> None:
        self._seen: dict[Diagnostic, None] = {}

    def add(self, code: str, prim_path: str, message: str, attribute: str = "") -> None:
        """Record one; KeyError if the code is not in `CODES`."""
        self._seen.setdefault(Diagnostic(CODES[code].severity, code, prim_path, message, attribute))

    def extend(self, others: Iterable[Diagnostic]) -> None:
        for diagnostic in others:
            self._seen.setdefault(diagnostic)

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._seen)

    def __len__(self) -> int:
        return len(self._seen)

    def raise_if_strict(self) -> None:
        """UnsupportedError naming the first warning or error about the picture and their number; the rest passes."""
        bad = [d for d in self._seen if d.is_strict]
        if bad:
            more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
            at = f"{bad[0].attribute}: " if bad[0].attribute else ""
            raise UnsupportedError(
                f"--strict: {bad[0].code}: {at}{bad[0].message}{more}", where=bad[0].prim_path, code="strict"
            )
