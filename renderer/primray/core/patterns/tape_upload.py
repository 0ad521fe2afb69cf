"""Compilation of shading graphs to tapes, and their upload to the core's scene builder: registers, code, images.

The nodes that wanted outputs depend on are compiled in order, none twice. `NODES` is the table of node functions; `NO_MEANING`
has the reasons why nodes of some types cannot be computed. Images whose coordinates are an affine map of a primvar are marked:
their visible resolution is known before rendering.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...arrays import Ints
from ...description import NodeOutput, Pattern, PatternInput, PatternNode, Surface, TextureFile, Wrap
from ...description.shading import GEOMPROPS, UV_TEXTURE
from .. import compiled
from ..inputs import filled
from .node_functions.compositing import CHANNEL_NODES, COMPOSITING_NODES
from .node_functions.images import HEXTILE_NODES, IMAGE_NODES, NORMAL_MAP_NODES, USD_NODES
from .node_functions.math_nodes import ADJUSTMENT_NODES, MATH_NODES, MATRIX_NODES
from .node_functions.pbr import PBR_NODES
from .node_functions.procedural import GEOMETRY_NODES, NOISE_NODES, RAMP_NODES
from .program import NO_SHIFT, SHIFT_RANGE, Node, NodeContext, Operation, Outputs, Program, Value

# MaterialX's primitive nodes and USD's own, by category: the function that compiles a node.
NODES: dict[str, Callable[[Node], Outputs]] = {
    **ADJUSTMENT_NODES, **MATH_NODES, **NORMAL_MAP_NODES, **CHANNEL_NODES, **COMPOSITING_NODES, **GEOMETRY_NODES,
    **HEXTILE_NODES, **IMAGE_NODES, **MATRIX_NODES, **NOISE_NODES, **PBR_NODES, **RAMP_NODES, **USD_NODES,
}  # fmt: skip

_CLOSURE = "describes how a surface scatters or emits light, and has no numeric value"
_TEXT = "is a string, which has no numeric value"
# Reasons by type of a node's first output.
NO_MEANING = {
    "BSDF": _CLOSURE, "EDF": _CLOSURE, "VDF": _CLOSURE, "surfaceshader": _CLOSURE, "volumeshader": _CLOSURE,
    "lightshader": _CLOSURE, "material": _CLOSURE, "displacementshader": "displaces points, which takes place before shading",
    "string": _TEXT, "filename": _TEXT,
}  # fmt: skip


class UnknownNodeError(Exception):
    """A node that cannot be computed here, with the reason."""


@dataclass
class Graph:
    """A pattern during compilation: values of each node's outputs, by node and shift."""

    pattern: Pattern
    around: NodeContext
    program: Program = field(default_factory=Program)
    _values: dict[tuple[int, int], Outputs] = field(default_factory=dict)
    _steps: dict[int, list[Value]] = field(default_factory=dict)

    def value(self, source: NodeOutput, shift: int = NO_SHIFT) -> Value:
        for node in self._missing(source.node, shift):
            self._compile(node, shift)
        made = self._values[source.node, shift]
        return made[source.output] if isinstance(made, dict) else made

    def _missing(self, node: int, shift: int) -> list[int]:
        """Return the node and the nodes it depends on that have no value yet, dependencies first."""
        found: set[int] = set()
        left = [node]
        while left:
            number = left.pop()
            if number in found or (number, shift) in self._values:
                continue
            found.add(number)
            left.extend(v.node for _, v in self.pattern.nodes[number].inputs if isinstance(v, NodeOutput))
        return sorted(found)

    def _compile(self, number: int, shift: int) -> None:
        own = self.pattern.nodes[number]
        if shift != NO_SHIFT:
            for node in self._missing(number, NO_SHIFT):
                self._compile(node, NO_SHIFT)
        before = self.program.steps, self.program.steps_here
        self.program.steps, self.program.steps_here = [], None if shift == NO_SHIFT else iter(self._steps[number])
        made = self._written(own, shift)
        if shift == NO_SHIFT:
            self._steps[number] = self.program.steps
        self.program.steps, self.program.steps_here = before
        self._values[number, shift] = made

    def _written(self, own: PatternNode, shift: int) -> Outputs:
        write = NODES.get(own.category)
        if write is None or own.type in NO_MEANING:
            raise UnknownNodeError(f"{own.signature or own.category} {NO_MEANING.get(own.type, 'is not known')}")
        inputs = dict(own.inputs)

        def read(name: str, shift: int) -> Value:
            operand = inputs[name]
            if isinstance(operand, NodeOutput):
                return self.value(operand, shift)
            if isinstance(operand, tuple):
                return self.program.constant(*operand)
            if isinstance(operand, str) and operand in GEOMPROPS:
                return self._geometry(operand, shift)
            raise UnknownNodeError(f"{own.signature or own.category} has no number as its {name}")

        try:
            return write(Node(self.program, own, shift, self.around, read))
        except KeyError as missing:
            raise UnknownNodeError(f"{own.signature or own.category} has no input {missing}") from missing

    def _geometry(self, name: str, shift: int) -> Value:
        category, space = GEOMPROPS[name]
        made = self._written(
            PatternNode(category, "vector2" if category == "texcoord" else "vector3", "", (("space", space),)), shift
        )
        assert isinstance(made, Value)
        return made


# Inputs that are evaluated alone, by cut-outs and by lights: first on the tape, so that nothing else runs for them.
FIRST = ("opacity", "emissive_color")
_COORDINATES = {"image": "texcoord", UV_TEXTURE: "st"}  # the coordinate input of image nodes, by category
_WRAP_INPUTS = ("uaddressmode", "vaddressmode", "wrapS", "wrapT")
WRAPS = {"constant": "CLAMP", "clamp": "CLAMP", "periodic": "REPEAT", "mirror": "MIRROR"}


class TooLargeError(Exception):
    """A pattern that needs more registers than the core has."""


@dataclass(frozen=True)
class SharedInputs:
    """Numbering of primvars and textures that a tape shares with the other inputs of surfaces."""

    primvar: Callable[[str], int]  # a name's number
    texture: Callable[[TextureFile, str], int | None]  # a texture's number, by channels; None where the file cannot be read
    wrap: Callable[[TextureFile, Wrap, int], str]  # the name of a file's wrap along s (0) or t (1)
    frame: float


@dataclass
class TapeContext:
    outside: SharedInputs
    object_space: bool = False
    images: list[compiled.PatternImage] = field(default_factory=list)
    _numbers: dict[tuple[object, ...], int] = field(default_factory=dict)
    _forms: AffineForms | None = None

    def _affine_coordinates(self, node: Node) -> AffineMap | None:
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
        worn, channels = self._affine_coordinates(node), node.text("channels", "r") if width == 1 else "rgb"
        asked = (file, channels, width == 4, *map(node.text, _WRAP_INPUTS), closest, worn)
        if asked not in self._numbers:
            color = self.outside.texture(file, channels)
            alpha = self.outside.texture(file, "a") if width == 4 else -1
            if color is None or alpha is None:
                return None
            made = filled(compiled.PatternImage(), color=color, alpha=alpha, closest=closest)
            if worn is not None:
                made.primvar, made.st_transform = worn.primvar, worn.transform
            made.wrap_s, made.wrap_t = (compiled.Wrap[wrap] for wrap in self._wraps(file, node))
            self.images.append(made)
            self._numbers[asked] = len(self.images) - 1
        return self._numbers[asked]


def pattern_inputs(surface: Surface) -> list[tuple[str, PatternInput]]:
    """Return the inputs that read the surface's pattern, in their order on its tape."""
    found = [(name, reads) for name, reads in surface.inputs if isinstance(reads, PatternInput)]
    return sorted(found, key=lambda item: FIRST.index(item[0]) if item[0] in FIRST else len(FIRST))


def tape_of(surface: Surface, outside: SharedInputs) -> tuple[compiled.Tape, dict[str, int]]:
    """Return the tape for the surface's pattern, and the output number of each input.

    Raise UnknownNodeError or TooLargeError.
    """
    assert surface.pattern is not None
    around = TapeContext(outside)
    graph = Graph(surface.pattern, around)
    wanted = pattern_inputs(surface)
    outputs = [_three_or_one(graph.value(reads.source)) for _, reads in wanted]
    numbers = {name: i for i, name in enumerate(compiled.pattern_operations())}
    code, constants, found, used = assemble(graph.program.operations, outputs, numbers)
    if used > compiled.PATTERN_REGISTERS:
        raise TooLargeError(f"it needs {used} registers, and there are {compiled.PATTERN_REGISTERS}")
    tape = filled(
        compiled.Tape(),
        code=_int_rows(code, 9),
        constants=constants,
        images=around.images,
        outputs=_int_rows(found, 3),
        asks_object_space=around.object_space,
    )
    return tape, {name: i for i, (name, _) in enumerate(wanted)}


def _three_or_one(value: Value) -> Value:
    """Return what inputs take: a colour, or one number."""
    return value.part(0, 3) if value.width >= 3 else value[0]


def _int_rows(values: Sequence[Sequence[int]], columns: int) -> Ints:
    return np.array(values, np.int32).reshape(-1, columns)


class Registers:
    """Free registers by length of their run; further ones are allocated where none fit."""

    def __init__(self) -> None:
        self.used = 0
        self._free: dict[int, list[int]] = {}

    def take(self, width: int) -> int:
        if free := self._free.get(width):
            return free.pop()
        self.used += width
        return self.used - width

    def give(self, first: int, width: int) -> None:
        self._free.setdefault(width, []).append(first)


def last_readers(operations: Sequence[Operation], outputs: Sequence[Value]) -> dict[int, int]:
    """Return the last reader of each operation that some output depends on; outputs count as read at the end."""
    last = {v.operation: len(operations) for v in outputs}
    for number in range(len(operations) - 1, -1, -1):
        if number in last:
            for operand, _, _ in operations[number].operands:
                last.setdefault(operand, number)
    return last


def assemble(
    operations: Sequence[Operation], outputs: Sequence[Value], numbers: Mapping[str, int]
) -> tuple[list[list[int]], list[float], list[list[int]], int]:
    """Return the core's code, constants and outputs, and the number of registers. `numbers`: the core's opcodes."""
    last = last_readers(operations, outputs)
    registers, at = Registers(), dict[int, int]()
    code: list[list[int]] = []
    constants: list[float] = []
    made: dict[int, int] = {}  # length of the code once each operation is computed
    for number in sorted(last):
        operation = operations[number]
        at[number] = registers.take(operation.width)
        code.extend(_instructions(operation, at, at[number], numbers, constants))
        made[number] = len(code)
        for operand in {read for read, _, _ in operation.operands}:
            if last[operand] == number:
                registers.give(at[operand], operations[operand].width)
    found = [[at[v.operation] + v.first, int(v.width > 1), made[v.operation]] for v in outputs]
    return code, constants, found, registers.used


def _instructions(
    operation: Operation, at: Mapping[int, int], out: int, numbers: Mapping[str, int], constants: list[float]
) -> list[list[int]]:
    places = [at[number] + first for number, first, _ in operation.operands]
    if operation.name == "pack":
        return [[numbers["move"], 1, 0, out + c, place, 0, 0, 0, 0] for c, place in enumerate(places)]
    steps = sum(step << k for k, (_, _, step) in enumerate(operation.operands))
    data = operation.data
    if isinstance(data, tuple):
        constants.extend(data)
        data = len(constants) - len(data)
    return [[numbers[operation.name], operation.width, steps, out, *(places + [0] * 4)[:4], data]]


@dataclass(frozen=True)
class AffineForm:
    """s x + t y + 1 z, for a primvar's s and t; a constant has no primvar."""

    primvar: int | None
    row: tuple[float, float, float]


@dataclass(frozen=True)
class AffineMap:
    """An affine map of a primvar's two numbers: a constant offset, rotation and scale."""

    primvar: int
    transform: tuple[float, ...]  # 2 x 3, row-major


class AffineForms:
    """Affine forms of the components of each operation; None where a component is not affine.

    Operands precede the operations that read them.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self._forms: list[list[AffineForm | None]] = []

    def of(self, at: Value) -> AffineMap | None:
        """Return the affine map that these coordinates are, or None."""
        operations = self._program.operations
        while len(self._forms) <= at.operation:
            self._forms.append(self._made(operations[len(self._forms)]))
        s, t = self._forms[at.operation][at.first : at.first + 2]
        if s is None or t is None:
            return None
        primvars = {form.primvar for form in (s, t)} - {None}
        return AffineMap(primvars.pop(), (*s.row, *t.row)) if len(primvars) == 1 else None  # type: ignore[arg-type]

    def _made(self, operation: Operation) -> list[AffineForm | None]:
        if isinstance(operation.data, tuple):
            return [AffineForm(None, (0.0, 0.0, value)) for value in operation.data]
        if operation.name == "primvar" and operation.width == 2 and operation.data % SHIFT_RANGE == 0:
            number = operation.data // SHIFT_RANGE
            return [AffineForm(number, (1.0, 0.0, 0.0)), AffineForm(number, (0.0, 1.0, 0.0))]
        if operation.name == "pack":
            return [self._forms[number][first] for number, first, _ in operation.operands]
        if operation.name not in ("add", "subtract", "multiply", "divide"):
            return [None] * operation.width
        (a, a_first, a_step), (b, b_first, b_step) = operation.operands
        return [
            _combined(operation.name, self._forms[a][a_first + a_step * c], self._forms[b][b_first + b_step * c])
            for c in range(operation.width)
        ]


def _combined(name: str, a: AffineForm | None, b: AffineForm | None) -> AffineForm | None:
    if a is None or b is None:
        return None
    if name == "multiply" and a.primvar is None:
        a, b = b, a
    if name in ("multiply", "divide"):
        if b.primvar is not None or (name == "divide" and not b.row[2]):
            return None
        factor = b.row[2] if name == "multiply" else 1 / b.row[2]
        return AffineForm(a.primvar, (a.row[0] * factor, a.row[1] * factor, a.row[2] * factor))
    if a.primvar is not None and b.primvar is not None and a.primvar != b.primvar:
        return None
    sign = 1 if name == "add" else -1
    x, y, z = (p + sign * q for p, q in zip(a.row, b.row, strict=True))
    return AffineForm(b.primvar if a.primvar is None else a.primvar, (x, y, z))
