# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: other shaders than Principled BSDF are made one before the export, and OpenPBR networks are repaired after it.

Repairs are of where Blender's Principled BSDF and OpenPBR differ: its coat does not darken, light that is transmitted meets the
base colour at each of two interfaces, and its anisotropy is another function of its roughness.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from pxr import Gf, Sdf, Usd, UsdShade

Note = Callable[[str, str, str], None]
OPEN_PBR = "ND_open_pbr_surface_surfaceshader"
# Nodes whose values differ in MaterialX, or that are lost there.
INEXACT = {
    "TEX_NOISE": "noise is another function",
    "TEX_VORONOI": "Voronoi is another function",
    "TEX_WAVE": "the wave texture is not exported",
    "TEX_MAGIC": "the magic texture is not exported",
    "TEX_SKY": "the sky texture is not exported",
    "BUMP": "bumps have another height",
    "HUE_SAT": "Hue/Saturation is another function",
    "ATTRIBUTE": "attributes are not exported: the socket's own value is used",
    "VERTEX_COLOR": "colour attributes are not exported: the socket's own value is used",
    "LAYER_WEIGHT": "Layer Weight is not exported",
    "FRESNEL": "Fresnel is not exported",
    "LIGHT_PATH": "Light Path is not exported",
    "SCRIPT": "scripts are not exported",
}


def rewrite_materials(note: Note) -> None:
    """Rewrite shaders into Principled BSDFs, and note what will differ from Blender."""
    for material in bpy.data.materials:
        if material.node_tree is None or material.library is not None:
            continue
        output = next((n for n in material.node_tree.nodes if n.type == "OUTPUT_MATERIAL" and n.is_active_output), None)
        if output is None:
            continue
        if output.inputs["Surface"].is_linked:
            shader = output.inputs["Surface"].links[0].from_node
            if shader.type != "BSDF_PRINCIPLED":
                made = _principled(material.node_tree, shader, material.name, note, 0)
                if made is not None:
                    material.node_tree.links.new(made.outputs[0], output.inputs["Surface"])
        if output.inputs["Displacement"].is_linked:
            note("displacement", material.name, "displacement is not exported")
        for node in material.node_tree.nodes:
            # Nodes of volumes are read by volumes.py.
            if output.inputs["Surface"].is_linked and node.type in INEXACT and any(socket.is_linked for socket in node.outputs):
                note("node", material.name, INEXACT[node.type])


def _new(tree: Any, **values: Any) -> Any:
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    for name, value in values.items():
        socket = node.inputs.get(name.replace("_", " "))
        if socket is not None:
            socket.default_value = value
    return node


def _pass_on(tree: Any, source: Any, target: Any) -> None:
    """Give a socket what another one has: its link, or its value."""
    if source.is_linked:
        tree.links.new(source.links[0].from_socket, target)
    elif hasattr(target.default_value, "__len__"):
        target.default_value = source.default_value
    else:
        target.default_value = source.default_value


def _principled(tree: Any, shader: Any, name: str, note: Note, depth: int) -> Any:
    """Return a Principled BSDF in the place of another shader; None, with a note, where there is no such."""
    pairs: dict[str, str] = {}
    match shader.type:
        case "BSDF_PRINCIPLED":
            return shader
        case "EMISSION":
            made = _new(tree, Base_Color=(0, 0, 0, 1), Specular_IOR_Level=0.0, Roughness=1.0)
            pairs = {"Color": "Emission Color", "Strength": "Emission Strength"}
        case "BSDF_DIFFUSE":
            made = _new(tree, Specular_IOR_Level=0.0)
            pairs = {"Color": "Base Color", "Roughness": "Diffuse Roughness", "Normal": "Normal"}
        case "BSDF_GLOSSY" | "BSDF_ANISOTROPIC" | "BSDF_METALLIC":
            made = _new(tree, Metallic=1.0)
            pairs = {"Color": "Base Color", "Base Color": "Base Color", "Roughness": "Roughness", "Normal": "Normal"}
            if shader.type != "BSDF_METALLIC":
                pairs |= {"Anisotropy": "Anisotropic", "Rotation": "Anisotropic Rotation"}
                note("shader", name, "a Glossy BSDF is rendered as metal, whose edges reflect all light")
        case "BSDF_GLASS":
            made = _new(tree, Transmission_Weight=1.0)
            pairs = {"Color": "Base Color", "Roughness": "Roughness", "IOR": "IOR", "Normal": "Normal"}
        case "BSDF_TRANSPARENT":
            made = _new(tree, Alpha=0.0)
            if not shader.inputs["Color"].is_linked and min(shader.inputs["Color"].default_value[:3]) < 0.999:
                note("shader", name, "the colour of a Transparent BSDF is ignored: it is clear")
        case "MIX_SHADER" if depth < 4:
            return _mixed(tree, shader, name, note, depth)
        case "ADD_SHADER" if depth < 4:
            return _added(tree, shader, name, note, depth)
        case _:
            kind = shader.bl_label or shader.type
            note("shader", name, f"{kind} is not exported as Blender renders it")
            return None
    for source, target in pairs.items():
        if source in shader.inputs and target in made.inputs:
            _pass_on(tree, shader.inputs[source], made.inputs[target])
    if shader.type == "BSDF_GLASS":
        # A Glass BSDF colours what it reflects, too.
        _pass_on(tree, shader.inputs["Color"], made.inputs["Specular Tint"])
        _square(tree, made.inputs["Base Color"])
    return made


def _square(tree: Any, socket: Any) -> None:
    """Square a colour: a Glass BSDF's is met at each interface, and the Principled BSDF's root is."""
    if not socket.is_linked:
        socket.default_value = [*(value**2 for value in socket.default_value[:3]), 1.0]
        return
    gamma = tree.nodes.new("ShaderNodeGamma")
    gamma.inputs["Gamma"].default_value = 2.0
    tree.links.new(socket.links[0].from_socket, gamma.inputs["Color"])
    tree.links.new(gamma.outputs["Color"], socket)


def _shaders(shader: Any, first: int) -> list[Any]:
    return [socket.links[0].from_node if socket.is_linked else None for socket in list(shader.inputs)[first : first + 2]]


def _mixed(tree: Any, shader: Any, name: str, note: Note, depth: int) -> Any:
    """Return a mix as one surface: of a transparent shader and another one exactly, of others by mixing their inputs."""
    pair = _shaders(shader, 1)
    if None in pair:
        note("shader", name, "a Mix Shader with an empty socket is not exported as Blender renders it")
        return None
    factor = shader.inputs[0]
    clear = [node.type == "BSDF_TRANSPARENT" for node in pair]
    if sum(clear) == 1:
        made = _principled(tree, pair[clear.index(False)], name, note, depth + 1)
        if made is None:
            return None
        if clear[1]:  # the factor is the share of the clear one
            inverse = tree.nodes.new("ShaderNodeMath")
            inverse.operation = "SUBTRACT"
            inverse.inputs[0].default_value = 1.0
            if factor.is_linked:
                tree.links.new(factor.links[0].from_socket, inverse.inputs[1])
                tree.links.new(inverse.outputs[0], made.inputs["Alpha"])
            else:
                made.inputs["Alpha"].default_value = 1 - factor.default_value
        else:
            _pass_on(tree, factor, made.inputs["Alpha"])
        return made
    both = [_principled(tree, node, name, note, depth + 1) for node in pair]
    if None in both:
        return None
    note("shader", name, "a Mix Shader is rendered as one surface with mixed inputs")
    made = _new(tree)
    for socket in made.inputs:
        a, b = both[0].inputs[socket.identifier], both[1].inputs[socket.identifier]
        if socket.type in ("VALUE", "RGBA"):
            _mix_into(tree, factor, a, b, socket)
        elif a.is_linked or b.is_linked:
            _pass_on(tree, a if a.is_linked else b, socket)
    return made


def _mix_into(tree: Any, factor: Any, a: Any, b: Any, target: Any) -> None:
    if not (factor.is_linked or a.is_linked or b.is_linked):
        t = factor.default_value
        if target.type == "VALUE":
            target.default_value = a.default_value + (b.default_value - a.default_value) * t
        else:
            target.default_value = [x + (y - x) * t for x, y in zip(a.default_value, b.default_value, strict=True)]
        return
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "FLOAT" if target.type == "VALUE" else "RGBA"
    sockets = {socket.name: socket for socket in mix.inputs if socket.enabled}
    _pass_on(tree, factor, sockets["Factor"])
    _pass_on(tree, a, sockets["A"])
    _pass_on(tree, b, sockets["B"])
    tree.links.new(next(socket for socket in mix.outputs if socket.enabled), target)


def _added(tree: Any, shader: Any, name: str, note: Note, depth: int) -> Any:
    """Return a shader with the emission of another one; other sums have no surface of their own."""
    pair = _shaders(shader, 0)
    emissive = [node is not None and node.type == "EMISSION" for node in pair]
    if None not in pair and sum(emissive) == 1:
        made = _principled(tree, pair[emissive.index(False)], name, note, depth + 1)
        if made is not None:
            emission = pair[emissive.index(True)]
            _pass_on(tree, emission.inputs["Color"], made.inputs["Emission Color"])
            _pass_on(tree, emission.inputs["Strength"], made.inputs["Emission Strength"])
            return made
    note("shader", name, "an Add Shader is not exported as Blender renders it")
    return None


def repair_networks(stage: Usd.Stage) -> None:
    """Author over each OpenPBR surface what makes it Blender's."""
    for prim in list(stage.Traverse()):
        shader = UsdShade.Shader(prim) if prim.IsA(UsdShade.Shader) else None
        if shader is None or shader.GetIdAttr().Get() != OPEN_PBR:
            continue
        if _constant(shader, "coat_weight", 0.0) != 0.0:
            shader.CreateInput("coat_darkening", Sdf.ValueTypeNames.Float).Set(0.0)
            _keep_reflection_below_coat(shader)
        if _constant(shader, "transmission_weight", 0.0) != 0.0:
            _root_of_transmission(stage, shader)
        anisotropy = _constant(shader, "specular_roughness_anisotropy", 0.0)
        roughness = _constant(shader, "specular_roughness", 0.3)
        if anisotropy and roughness is not None:
            a = min(anisotropy / 0.7 * 0.9, 0.99)  # the exporter writes 0.7 of Blender's
            shader.GetInput("specular_roughness_anisotropy").Set(a)
            shader.CreateInput("specular_roughness", Sdf.ValueTypeNames.Float).Set(
                min(roughness * ((1 + (1 - a) ** 2) / 2 / (1 - a)) ** 0.25, 1.0)
            )
            _turn_tangent(stage, shader)


def _turn_tangent(stage: Usd.Stage, shader: Any) -> None:
    """Turn the tangent by a quarter: the exporter has it across the highlight, and OpenPBR's highlight is long along it."""
    prim, found = shader.GetPrim(), shader.GetInput("geometry_tangent")
    while found and found.HasConnectedSource():
        node = UsdShade.Shader(found.GetValueProducingAttributes()[0].GetPrim())  # the output of a node graph leads to it
        if node.GetIdAttr().Get() == "ND_rotate3d_vector3":
            break
        found = node.GetInput("in")
    else:
        return
    amount = node.GetInput("amount")
    if not amount or not amount.HasConnectedSource():
        node.CreateInput("amount", Sdf.ValueTypeNames.Float).Set(((amount.Get() if amount else 0.0) or 0.0) + 90.0)
        return
    turned = UsdShade.Shader.Define(stage, prim.GetPath().ReplaceName(f"{prim.GetPath().name}_turn"))
    turned.CreateIdAttr("ND_add_float")
    turned.CreateInput("in1", Sdf.ValueTypeNames.Float).ConnectToSource(amount.GetConnectedSources()[0][0])
    turned.CreateInput("in2", Sdf.ValueTypeNames.Float).Set(90.0)
    amount.ConnectToSource(turned.CreateOutput("out", Sdf.ValueTypeNames.Float))


def _keep_reflection_below_coat(shader: Any) -> None:
    """Let the base reflect as in air: OpenPBR's index is relative to the coat's, in which a base of the same index vanishes."""
    weight, coat = _constant(shader, "coat_weight", 0.0), _constant(shader, "coat_ior", 1.6)
    index = _constant(shader, "specular_ior", 1.5)
    if weight is not None and coat is not None and index is not None and _constant(shader, "transmission_weight", 0.0) == 0.0:
        shader.CreateInput("specular_ior", Sdf.ValueTypeNames.Float).Set(index * (1 + (coat - 1) * weight))


def _constant(shader: Any, name: str, default: float) -> float | None:
    """Return an input's value, the default where it has none, and None where it is connected."""
    found = shader.GetInput(name)
    if not found:
        return default
    if found.HasConnectedSource():
        return None
    value = found.Get()
    return default if value is None else value


def _root_of_transmission(stage: Usd.Stage, shader: Any) -> None:
    """Take the square root of the colour, which light meets as it comes in and again as it leaves."""
    found = shader.GetInput("transmission_color")
    if not found:
        return
    if not found.HasConnectedSource():
        found.Set(Gf.Vec3f(*[max(value, 0.0) ** 0.5 for value in found.Get()]))
        return
    source = found.GetConnectedSources()[0][0]
    root = UsdShade.Shader.Define(stage, shader.GetPath().ReplaceName(f"{shader.GetPath().name}_transmission"))
    root.CreateIdAttr("ND_power_color3FA")
    root.CreateInput("in1", Sdf.ValueTypeNames.Color3f).ConnectToSource(source)
    root.CreateInput("in2", Sdf.ValueTypeNames.Float).Set(0.5)
    found.ConnectToSource(root.CreateOutput("out", Sdf.ValueTypeNames.Color3f))
