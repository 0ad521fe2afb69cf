"""Upload of the tapes of surfaces with patterns to the core's scene builder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...description import PatternInput, Surface, TextureFile, Wrap
from ...description.patterns import UV_TEXTURE
from ..core_inputs import filled
from .affine import Affine, AffineForms
from .compiling import Graph
from .node import NO_SHIFT, Node
from .program import Value
from .registers import assemble

# Inputs that are evaluated alone, by cut-outs and by lights: first on the tape, so that nothing else runs for them.
FIRST = ("opacity", "emissive_color")
_COORDINATES = {"image": "texcoord", UV_TEXTURE: "st"}  # the coordinate input of image nodes, by category
_WRAP_INPUTS = ("uaddressmode", "vaddressmode", "wrapS", "wrapT")
WRAPS = {"constant": "CLAMP", "clamp": "CLAMP", "periodic": "REPEAT", "mirror": "MIRROR"}


class TooLargeError(Exception):
    """A pattern that needs more registers than the core has."""


@dataclass(frozen=True)
class Outside:
    """Numbering of primvars and textures that a tape shares with the other inputs of surfaces."""

    core: Any
    primvar: Callable[[str], int]  # a name's number
    texture: Callable[[TextureFile, str], int | None]  # a texture's number, by channels; None where the file cannot be read
    wrap: Callable[[TextureFile, Wrap, int], str]  # the name of a file's wrap along s (0) or t (1)
    frame: float


@dataclass
class TapeSurroundings:
    outside: Outside
    object_space: bool = False
    images: list[Any] = field(default_factory=list)
    _numbers: dict[tuple[Any, ...], int] = field(default_factory=dict)
    _forms: AffineForms | None = None

    def _worn(self, node: Node) -> Affine | None:
        coordinates = _COORDINATES.get(node.own.category)
        if coordinates is None:
            return None
        self._forms = self._forms or AffineForms(node.program)
        return self._forms.of(node.read(coordinates, NO_SHIFT))

    def _wraps(self, file: TextureFile, node: Node) -> list[str]:
        if node.own.category == UV_TEXTURE:
            return [self.outside.wrap(file, Wrap(node.text(name)), axis) for axis, name in enumerate(("wrapS", "wrapT"))]
        return [WRAPS.get(node.text(mode, "periodic"), "REPEAT") for mode in ("uaddressmode", "vaddressmode")]

    def primvar(self, name: str) -> int:
        return self.outside.primvar(name)

    def frame(self) -> float:
        return self.outside.frame

    def image(self, file: TextureFile, width: int, node: Node) -> int | None:
        closest = node.text("filtertype") == "closest"
        worn, channels = self._worn(node), node.text("channels", "r") if width == 1 else "rgb"
        asked = (file, channels, width == 4, *map(node.text, _WRAP_INPUTS), closest, worn)
        if asked not in self._numbers:
            color = self.outside.texture(file, channels)
            alpha = self.outside.texture(file, "a") if width == 4 else -1
            if color is None or alpha is None:
                return None
            wrap, wraps = self.outside.core.Wrap, self._wraps(file, node)
            made = filled(self.outside.core.PatternImage(), color=color, alpha=alpha, closest=closest)
            if worn is not None:
                filled(made, primvar=worn.primvar, st_transform=worn.transform)
            self.images.append(filled(made, wrap_s=wrap[wraps[0]], wrap_t=wrap[wraps[1]]))
            self._numbers[asked] = len(self.images) - 1
        return self._numbers[asked]


def pattern_inputs(surface: Surface) -> list[tuple[str, PatternInput]]:
    """Return the inputs that read the surface's pattern, in their order on its tape."""
    found = [(name, reads) for name, reads in surface.inputs if isinstance(reads, PatternInput)]
    return sorted(found, key=lambda item: FIRST.index(item[0]) if item[0] in FIRST else len(FIRST))


def tape_of(surface: Surface, outside: Outside) -> tuple[Any, dict[str, int]]:
    """Return the core's Tape for the surface's pattern, and the output number of each input.

    Raise UnknownNodeError or TooLargeError.
    """
    assert surface.pattern is not None
    around = TapeSurroundings(outside)
    graph = Graph(surface.pattern, around)
    wanted = pattern_inputs(surface)
    outputs = [_three_or_one(graph.value(reads.source)) for _, reads in wanted]
    numbers = {name: i for i, name in enumerate(outside.core.pattern_operations)}
    code, constants, found, used = assemble(graph.program.operations, outputs, numbers)
    if used > outside.core.pattern_registers:
        raise TooLargeError(f"it needs {used} registers, and there are {outside.core.pattern_registers}")
    tape = filled(
        outside.core.Tape(),
        code=_rows(code, 9),
        constants=constants,
        images=around.images,
        outputs=_rows(found, 3),
        asks_object_space=around.object_space,
    )
    return tape, {name: i for i, (name, _) in enumerate(wanted)}


def _three_or_one(value: Value) -> Value:
    """Return what inputs take: a colour, or one number."""
    return value.part(0, 3) if value.width >= 3 else value[0]


def _rows(values: Sequence[Sequence[int]], columns: int) -> Any:
    return np.array(values, np.int32).reshape(-1, columns)
