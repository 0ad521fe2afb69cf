"""What is authored in the shading network of a material: its prims, with inputs and outputs, each part read on first use.

Each is read once for a material. Only values that USD cannot read are reported here; network.py follows connections, and
reports what is wrong with them.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf, Usd, UsdShade

from ..stage.read_once import ReadOnce
from ..stage.reads import color_space_name, connections, default_value, property_names, shader_id
from ..stage.values import When, time_of, value
from .materialx.document_marks import DEFAULT_NODE

INPUT = "inputs:"
PRINCIPLED = "principledshader"
_ASSETS = ("info:sourceAsset", "info:karma:sourceAsset", "info:vex:sourceAsset", "info:VEX:sourceAsset")


def attribute_of(prim: Usd.Prim, name: str) -> Usd.Attribute:
    """Return an attribute that is known to be there, without a check."""
    return prim.GetAttribute(name)


class AuthoredAttribute:
    """An input or output of a shader, a node graph or a material, under its whole name ("inputs:roughness")."""

    def __init__(self, name: str, attribute: Usd.Attribute, when: When) -> None:
        self.name, self.attribute, self._when = name, attribute, when
        self.connections = connections(attribute)

    @ReadOnce
    def value(self) -> Any:
        """Value at the time of the render, None where there is none; it counts where no connection gives one."""
        return value(self.attribute, self._when)

    @ReadOnce
    def color_space(self) -> str:
        """Colour space in the attribute's own metadata, "" where none is authored."""
        return color_space_name(self.attribute)

    @ReadOnce
    def layer(self) -> Sdf.Layer | None:
        """The layer that the value is authored in, at which relative file names are anchored."""
        for spec in self.attribute.GetPropertyStack(time_of(self.attribute, self._when)):
            if isinstance(spec, Sdf.AttributeSpec) and (spec.HasDefaultValue() or spec.HasInfo("timeSamples")):
                return spec.layer
        return None

    @ReadOnce
    def default_node(self) -> Usd.Prim | None:
        """The node that gives what an input of a MaterialX document has by default."""
        attribute = self.attribute
        name = attribute.GetCustomDataByKey(DEFAULT_NODE) if attribute.HasAuthoredMetadata("customData") else None
        prim = attribute.GetPrim().GetChild(name) if isinstance(name, str) and Sdf.Path.IsValidIdentifier(name) else None
        return prim or None


class AuthoredPrim:
    """A prim of a shading network: a shader, a node graph or a material; `known_id`: a shader's id that has been read."""

    def __init__(self, prim: Usd.Prim, path: Sdf.Path, when: When, known_id: str | None = None) -> None:
        self.prim, self.path, self._when = prim, path, when
        self._attributes: dict[str, AuthoredAttribute | None] = {}
        if known_id is not None:
            self.__dict__["is_shader"], self.__dict__["id"] = True, known_id

    @ReadOnce
    def is_shader(self) -> bool:
        return bool(self.prim.IsA(UsdShade.Shader))

    @ReadOnce
    def id(self) -> str:
        """Shader id, "" where there is none."""
        return shader_id(self.prim)

    @ReadOnce
    def module(self) -> str:
        """Path of a shader's MDL module, "" where it has none."""
        asset = default_value(self.prim.GetAttribute("info:mdl:sourceAsset"))
        return str(asset.path) if isinstance(asset, Sdf.AssetPath) else ""

    @ReadOnce
    def is_principled(self) -> bool:
        """Whether the source asset of a shader without id is a principled shader's surface, of any version."""
        for name in _ASSETS:
            attribute = self.prim.GetAttribute(name)
            asset = default_value(attribute) if attribute else None
            if isinstance(asset, Sdf.AssetPath) and f"/{PRINCIPLED}" in asset.path and "Displacement" not in asset.path:
                return True
        return False

    @ReadOnce
    def names(self) -> list[str]:
        """Names of the authored properties."""
        return property_names(self.prim)

    @ReadOnce
    def inputs(self) -> list[str]:
        """Names of the authored inputs, without "inputs:"."""
        return [name[len(INPUT) :] for name in self.names if name.startswith(INPUT)]

    @property
    def attributes_read(self) -> dict[str, AuthoredAttribute | None]:
        """The attributes that have been asked for, by name; None where there is none."""
        return self._attributes

    def attribute(self, name: str) -> AuthoredAttribute | None:
        """Return an attribute, None where the prim has none of this name."""
        known = self._attributes
        if name not in known:
            found = self.prim.GetAttribute(name)
            known[name] = AuthoredAttribute(name, found, self._when) if found else None
        return known[name]
