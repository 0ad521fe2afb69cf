"""What each diagnostic's code means for the picture's fidelity to its stage, and what a user can do about it.

docs/fidelity.md is generated from this table and `diagnostics.CODES`; a code has its row in both.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """In what way the picture keeps to the stage, worst first."""

    MISSING = "missing"  # a part of the picture, or of the input, is not there
    IGNORED = "ignored"  # something authored has no effect
    APPROXIMATED = "approximated"  # honoured, not exactly
    OUT_OF_RANGE = "out-of-range"  # a value that is not allowed: the nearest allowed one is used
    DEFAULTED = "defaulted"  # a value that cannot be used, or none where one is needed: the default is used
    CHOSEN = "chosen"  # the stage leaves something open: a choice was made
    NOTE = "note"  # the picture is as the stage says

    @property
    def changes_picture(self) -> bool:
        return self not in (Kind.CHOSEN, Kind.NOTE)


@dataclass(frozen=True)
class Fidelity:
    kind: Kind
    advice: str


FIDELITY: dict[str, Fidelity] = {
    "composition-error": Fidelity(Kind.MISSING, "Correct the path of the layer, or bring the file that it names."),
    "usd-message": Fidelity(
        Kind.IGNORED, "Read what USD says: it left out what it complains about. `usdchecker` finds the place."
    ),
    "time-metadata": Fidelity(Kind.DEFAULTED, "Author a positive, finite timeCodesPerSecond in the layer."),
    "stage-metadata": Fidelity(Kind.DEFAULTED, "Author upAxis as Y or Z, metersPerUnit as a positive number."),
    "layer-units": Fidelity(
        Kind.NOTE, "If the layer's content comes out turned or in the wrong size, scale or rotate the prim that references it."
    ),
    "payloads-unloaded": Fidelity(Kind.MISSING, "Leave out `--no-payloads`, or name the payload with `--load`."),
    "unsupported-prim": Fidelity(Kind.MISSING, "Convert it to a mesh, points or an implicit shape before rendering."),
    "unknown-prim-type": Fidelity(
        Kind.IGNORED, "Correct the type's name. A type of another program's own schema cannot be rendered: bake it to a mesh."
    ),
    "api-schema": Fidelity(
        Kind.IGNORED, "Remove the schema if it means nothing here; otherwise bake what it does into attributes of the prim."
    ),
    "skinning": Fidelity(Kind.IGNORED, "Bake the skinning into the points (UsdSkel.BakeSkinning) before rendering."),
    "posed": Fidelity(Kind.NOTE, "Nothing: the pose is the one of the frame that is rendered."),
    "points": Fidelity(Kind.NOTE, "Nothing: author `widths` if the spheres' size is not the one meant."),
    "draw-mode": Fidelity(Kind.NOTE, 'Author model:drawMode = "default" on the model to see its geometry.'),
    "draw-mode-input": Fidelity(Kind.IGNORED, "Author an extentsHint or a texture that can be read for the model's draw mode."),
    "motion": Fidelity(
        Kind.IGNORED, "Render further frames in place of the blur; author samples at the frames to avoid velocities."
    ),
    "color-space": Fidelity(Kind.IGNORED, "Convert the values to linear Rec.709, or remove the colour space."),
    "wrong-type": Fidelity(Kind.DEFAULTED, "Author a finite value of the type that the schema gives to the attribute."),
    "out-of-range": Fidelity(Kind.OUT_OF_RANGE, "Author a value in the range that the message names."),
    "invalid-mesh": Fidelity(
        Kind.MISSING, "Correct faceVertexCounts, faceVertexIndices and points so that they fit each other."
    ),
    "faces-dropped": Fidelity(Kind.MISSING, "Correct the faces' indices, and points that are not finite."),
    "shape-input": Fidelity(Kind.IGNORED, "Use a mesh in place of the shape."),
    "faces-degenerate": Fidelity(Kind.NOTE, "Nothing: remove the faces without area to be rid of the message."),
    "invalid-primvar": Fidelity(Kind.IGNORED, "Author as many values as the interpolation needs, and indices within them."),
    "subdivision-data": Fidelity(
        Kind.IGNORED, "Correct the creases, corners or rules; a polygonal mesh says `none` as its scheme."
    ),
    "cage-topology": Fidelity(Kind.APPROXIMATED, "Separate the faces that meet at the edge, so that two at most share it."),
    "dicing-limited": Fidelity(Kind.APPROXIMATED, "Raise `--max-memory`, or take a larger `--dicing-rate` for an even result."),
    "tessellated": Fidelity(Kind.APPROXIMATED, "Nothing at usual sizes; a mesh of your own if its silhouette shows edges."),
    "subset-ignored": Fidelity(Kind.IGNORED, "Correct the subset's indices, and make its elementType `face`."),
    "subset-overlap": Fidelity(Kind.IGNORED, "Let each face be in one subset of the family materialBind."),
    "subset-incomplete": Fidelity(Kind.NOTE, "Put the faces that are left over in a subset, or say `nonOverlapping`."),
    "primvar-missing": Fidelity(Kind.DEFAULTED, "Author the primvar on the shape, or correct the reader's varname."),
    "instance-primvar": Fidelity(Kind.IGNORED, "Author one value for each instance, of one to four numbers."),
    "invalid-instancer": Fidelity(
        Kind.MISSING, "Make the instancer's arrays as long as each other, its indices within its prototypes."
    ),
    "instances-coincident": Fidelity(Kind.NOTE, "Nothing: remove the copies to be rid of the message."),
    "invalid-transform": Fidelity(Kind.MISSING, "Correct the transform: it holds values that are not finite."),
    "reset-xform-in-prototype": Fidelity(Kind.APPROXIMATED, "Make the prim not instanceable, or leave out !resetXformStack!."),
    "unsupported-light": Fidelity(
        Kind.MISSING, "Replace the light by one that is supported, such as a RectLight or a DomeLight."
    ),
    "link-empty": Fidelity(Kind.NOTE, "Correct the collection's targets if the light was meant to reach something."),
    "link-limited": Fidelity(Kind.IGNORED, "Use fewer distinct collections for linking, or link fewer instances apart."),
    "light-input": Fidelity(
        Kind.IGNORED, "Remove the input if it means nothing for this light; the message says what is used."
    ),
    "light-dark": Fidelity(Kind.NOTE, "Give the light a size, or author `inputs:normalize`."),
    "instanced-lights": Fidelity(Kind.MISSING, "Use fewer instances of the light, or one larger light in their place."),
    "old-attribute": Fidelity(
        Kind.IGNORED, "Rename the attribute: UsdLux since USD 21.02 reads it with `inputs:` before its name."
    ),
    "asset-missing": Fidelity(Kind.MISSING, "Bring the file, or correct its path."),
    "texture-unset": Fidelity(Kind.DEFAULTED, "Author the node's `inputs:file`, or disconnect the node."),
    "shader-ignored": Fidelity(Kind.IGNORED, "Give the material a UsdPreviewSurface beside the other renderer's shader."),
    "shader-connection": Fidelity(Kind.IGNORED, "Connect the input to one existing output or interface input."),
    "shader-parameter": Fidelity(Kind.DEFAULTED, "Author a value that the node's definition knows."),
    "connection-type": Fidelity(Kind.APPROXIMATED, "Connect an output of the input's type, such as rgb to a colour."),
    "material-input": Fidelity(Kind.DEFAULTED, "Feed the input by a value, a texture or a primvar reader."),
    "unknown-input": Fidelity(Kind.IGNORED, "Correct the input's name, apply the schema that defines it, or remove it."),
    "other-renderer": Fidelity(
        Kind.IGNORED, "Nothing: these settings speak to another renderer; author what matters in USD's own."
    ),
    "displacement": Fidelity(Kind.IGNORED, "Displace the mesh before rendering."),
    "binding-missing": Fidelity(Kind.IGNORED, "Correct the binding's target, or bring the layer that has the material."),
    "binding-expression": Fidelity(Kind.APPROXIMATED, "Bind the material to the instances, or inside their prototype."),
    "camera-chosen": Fidelity(Kind.CHOSEN, "Ask for a camera with `--camera`, or author it in RenderSettings."),
    "camera-automatic": Fidelity(Kind.CHOSEN, "Add a camera to the stage."),
    "camera-scaled": Fidelity(Kind.APPROXIMATED, "Take scale and shear out of the camera's transform and its parents'."),
    "camera-input": Fidelity(Kind.IGNORED, "Author a value that the message allows, or remove it."),
    "render-settings-input": Fidelity(Kind.IGNORED, "Author a value that is supported, or ask for it on the command line."),
    "product-chosen": Fidelity(Kind.CHOSEN, "Name another product, or render each of them."),
    "render-var": Fidelity(Kind.IGNORED, "Name an output that there is (docs/aovs.md) and a type of numbers, or remove it."),
    "aov-empty": Fidelity(Kind.NOTE, "Correct the primvar's name, or author it on a shape of the picture."),
    "aovs-not-merged": Fidelity(
        Kind.MISSING, "Render a few samples with the same settings for the AOVs: they are without noise."
    ),
    "default-light": Fidelity(Kind.CHOSEN, "Add a light, or say `--no-default-light`."),
    "singular-transform": Fidelity(
        Kind.MISSING, "Correct scales of 0; a part that is meant to be hidden can be made invisible."
    ),
    "too-far": Fidelity(Kind.MISSING, "Move what lies this far away closer, or make it invisible."),
    "far-edges": Fidelity(Kind.APPROXIMATED, "Cut the shape into smaller ones, or leave out what reaches this far."),
    "emitters-unsampled": Fidelity(Kind.NOTE, "Take more samples, or let fewer instances emit."),
    "invalid-samples": Fidelity(
        Kind.MISSING, "Look for values of extreme size in materials and lights; the message counts the samples."
    ),
    "checkpoint-unwritten": Fidelity(Kind.NOTE, "Make room or grant access where checkpoints are written."),
    "samples-missing": Fidelity(Kind.MISSING, "Merge the parts that were left out too."),
    "texture-bad-texels": Fidelity(Kind.OUT_OF_RANGE, "Write the file anew with finite values that are not negative."),
    "texture-outside": Fidelity(
        Kind.NOTE, "Author wrapS and wrapT on the texture node; USD's default outside the file is black."
    ),
    "texture-turned": Fidelity(Kind.NOTE, "Store the pixels the way they are to be seen, without an EXIF orientation."),
    "texture-unreadable": Fidelity(Kind.MISSING, "Write the file anew in a format that is supported, or make it smaller."),
}
