"""Inputs of an MDL shader as operands: numbers, colours, switches, and textures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pxr import Sdf

from ....description import Operand, TextureFile
from ..authored import INPUT
from ..materialx.definitions import InputDefinition
from ..materialx.expressions import Expressions
from ..models.open_pbr import NORMAL, Reader
from ..network import Constant, Node, as_numbers
from ..node_values import NodeValues
from ..texture_files import texture_file

_IMAGE = {1: "float", 3: "color3", 4: "color4"}
_TYPES = {1: "float", 2: "vector2", 3: "color3"}
_LOOKUP_FILES = ("texture", "tex", "file")  # names of the file in MDL's texture lookup functions
_LOOKUP_SETS = ("tex_coord_index", "uv_space_index")

ANY = object()  # instead of a neutral value: the input has no effect on an image, whatever its value
NeutralValues = Mapping[str, object]  # inputs that are not read, and the values at which they have no effect


@dataclass
class MdlInputs:
    """The inputs of one MDL shader.

    `read`: names of inputs that have been read; `lost`: names of those that cannot be read.
    """

    shader: Node
    values: NodeValues
    st: Operand = "UV0"
    read: set[str] = field(default_factory=set)
    lost: set[str] = field(default_factory=set)

    @property
    def expressions(self) -> Expressions:
        return self.values.expressions

    @property
    def reader(self) -> Reader:
        """A Reader without inputs, for helpers that surface models share."""
        return Reader({}, self.expressions)

    def has(self, name: str) -> bool:
        """Return whether the shader authors an input."""
        self.read.add(name)
        return self.shader.source(name) is not None

    def constant(self, name: str, *default: float) -> tuple[float, ...]:
        """Return an input's constant, as many numbers as the default has."""
        self.read.add(name)
        found = self.shader.source(name)
        if isinstance(found, Node):
            self.lost.add(name)
        if not isinstance(found, Constant) or isinstance(
            found.value, Sdf.AssetPath
        ):  # an input may be a file instead of a number
            return default
        made = self.values.constant(found, InputDefinition(name, _TYPES[len(default)], default), self.shader)
        return made if isinstance(made, tuple) else default

    def is_on(self, name: str, default: bool = False) -> bool:
        """Return whether a switch is on."""
        return self.constant(name, float(default))[0] != 0

    def image(self, name: str, width: int, default: tuple[float, ...], *, is_color: bool = False) -> Operand | None:
        """Return the texture that an input names, or that the lookup connected to it names; None where there is none."""
        self.read.add(name)
        found = self.shader.source(name)
        if isinstance(found, Node):
            lookup = next((n for n in _LOOKUP_FILES if found.shader.attribute(INPUT + n) is not None), None)
            if lookup is None:
                self.lost.add(name)
                return None
            self.lost.discard(name)
            return self._image(found, lookup, width, default, is_color, self._looked_up_at(found, name, lookup))
        names_file = isinstance(found, Constant) and isinstance(found.value, Sdf.AssetPath)
        return self._image(self.shader, name, width, default, is_color, self.st) if names_file else None

    def _image(
        self, node: Node, name: str, width: int, default: tuple[float, ...], is_color: bool, st: Operand
    ) -> Operand | None:
        file = texture_file(node, is_color=is_color, name=name)
        if not isinstance(file, TextureFile) or not file.path:
            return None
        kind = _IMAGE[width]
        return self.expressions.apply(f"ND_image_{kind}", file=file, default=default, texcoord=st)

    def _looked_up_at(self, lookup: Node, name: str, file: str) -> Operand:
        """Return the texture coordinates of a lookup function, which may number their set; its other inputs are lost."""
        own = MdlInputs(lookup, self.values)
        own.read.add(file)
        index = next((n for n in _LOOKUP_SETS if own.has(n)), None)
        own.read -= set(_LOOKUP_SETS) - {index}
        st = own.set_of(index) if index else self.st
        self.lost |= {f"{name}.{other}" for other in own.unread({})}
        return st

    def set_of(self, name: str) -> Operand:
        """Return the texture coordinates of the set that an input numbers."""
        index = self.constant(name, 0.0)
        return "UV0" if index == (0.0,) else self.expressions.apply("ND_texcoord_vector2", index=index)

    def unread(self, neutral: NeutralValues) -> list[str]:
        """Return the names of authored inputs whose effect is lost: never read, or impossible to read."""
        names = {*self.shader.shader.inputs} - self.read
        left = {name for name in names if name not in neutral or not self._is_at(name, neutral[name])}
        return sorted(left | self.lost)

    def _is_at(self, name: str, rest: object) -> bool:
        if rest is ANY:
            return True
        found = self.shader.source(name)
        return found is None or (isinstance(found, Constant) and as_numbers(found.value) == rest)

    def normal(self, name: str, strength: float) -> Operand:
        """Return a tangent-space normal map's normal in world space."""
        texels = self.image(name, 3, (0.5, 0.5, 1.0))
        if texels is None:
            return NORMAL
        as_vector = self.expressions.apply("ND_convert_color3_vector3", **{"in": texels})
        return self.expressions.apply("ND_normalmap_float", **{"in": as_vector, "scale": (strength,)})

    def scaled(self, color: Operand, by: Operand) -> Operand:
        """Return a colour times a number."""
        return self.expressions.apply("ND_multiply_color3FA", in1=color, in2=by)

    def product(self, a: Operand, b: Operand) -> Operand:
        """Return the product of two colours."""
        return self.expressions.apply("ND_multiply_color3", in1=a, in2=b)

    def channel(self, color: Operand, index: int) -> Operand:
        """Return a channel of a colour."""
        return self.expressions.apply("ND_extract_color3", **{"in": color, "index": (float(index),)})

    def mixed(self, a: Operand, b: Operand | None, by: float) -> Operand:
        """Return a number interpolated from a to b; a where b is None."""
        return a if b is None else self.expressions.apply("ND_mix_float", bg=a, fg=b, mix=(by,))

    def place(self, translate: str, rotate: str, scale: str) -> None:
        """Scale, rotate and translate the coordinates of textures that are read from here on."""
        e = self.expressions
        st = e.apply("ND_multiply_vector2", in1=self.st, in2=self.constant(scale, 1.0, 1.0))
        turn = self.constant(rotate, 0.0)
        st = e.apply("ND_rotate2d_vector2", **{"in": st, "amount": (-turn[0],)}) if turn != (0.0,) else st
        self.st = e.apply("ND_add_vector2", in1=st, in2=self.constant(translate, 0.0, 0.0))
