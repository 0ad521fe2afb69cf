# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports of shapes and materials that stay from frame to frame: only what differs from the last export is exported again.

What an object or a material is exported as depends on what fingerprints hash: evaluated meshes, slots, modifiers, node trees.
Each export's layer is composed of the specs of its objects and materials, exported now or earlier, in the order of their names;
transforms are written from the evaluated scene each time. Blender's exporter is asked for shapes without networks, and
for the networks of materials on one quadrangle each: they take it 25 ms a material.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from pxr import Gf, Sdf, UsdUtils

from .geometry import Found, Prototype
from .placement import local_rows

NAMED = "userProperties:blender:object_name"
DATA_NAMED = "userProperties:blender:data_name"
MATERIALS = Sdf.Path("/root/_materials")
# Properties of RNA that are about editors, of anything and of nodes, and what an image's export depends on.
SHOWN = {"rna_type", "animation_data", "preview", "interface", "links", "original", "session_uid", "is_active", "show_expanded",
         "show_in_editmode", "show_on_cage", "use_pin_to_last", "execution_time", "persistent_uid"}  # fmt: skip
NODE_SHOWN = {"location", "location_absolute", "width", "width_hidden", "height", "dimensions", "select", "show_options",
              "color", "show_preview", "show_texture", "hide", "parent", "internal_links", "color_tag", "use_custom_color",
              "label", "warning_propagation", "debug_options"}  # fmt: skip
IMAGE = ("name", "filepath", "source", "alpha_mode", "colorspace_settings")
PLACES = ("EMPTY", "CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER")  # objects that are exported as places for others
# Members of attributes' elements, and their types, by the attributes' types.
MEMBERS = {
    "FLOAT": ("value", np.float32, 1), "FLOAT_VECTOR": ("vector", np.float32, 3), "FLOAT2": ("vector", np.float32, 2),
    "FLOAT_COLOR": ("color", np.float32, 4), "BYTE_COLOR": ("color", np.float32, 4), "INT": ("value", np.int32, 1),
    "INT8": ("value", np.int32, 1), "BOOLEAN": ("value", bool, 1), "INT32_2D": ("value", np.int32, 2),
    "INT16_2D": ("value", np.int32, 2), "QUATERNION": ("value", np.float32, 4), "FLOAT4X4": ("value", np.float32, 16),
}  # fmt: skip


@dataclass
class Exported:
    """What one object or material was exported as: `path` in `layer`, None if nothing was."""

    fingerprint: str | None  # None: never the same again
    layer: Any = None
    path: Sdf.Path | None = None


@dataclass
class Shapes:
    """The evaluated scene's fingerprints and world matrices, by the names of objects."""

    fingerprints: dict[str, str | None] = field(default_factory=dict)
    worlds: dict[str, Any] = field(default_factory=dict)


@dataclass
class Kept:
    objects: dict[str, Exported] = field(default_factory=dict)
    materials: dict[str, Exported] = field(default_factory=dict)


KEPT: dict[tuple[str, str], Kept] = {}  # by scene and view layer


def look_at(depsgraph: Any) -> Shapes:
    """Take fingerprints and places of what an evaluated scene has."""
    shapes = Shapes()
    for instance in depsgraph.object_instances:
        obj = instance.object
        name = obj.original.name
        if not instance.is_instance:
            shapes.worlds[name] = instance.matrix_world.copy()
            parent = obj.parent
            while parent is not None:
                shapes.worlds.setdefault(parent.original.name, parent.matrix_world.copy())
                parent = parent.parent
        # What nodes have made is handed out under the name of the object whose nodes these are.
        is_made = instance.is_instance and instance.parent is not None and instance.parent.original == obj.original
        if name not in shapes.fingerprints and not is_made:
            shapes.fingerprints[name] = _of_object(obj)
    return shapes


def export(
    scene: Any, view_layer: str, file: Path, shapes: Shapes, found: Found, prototypes: dict[str, Prototype],
    write: Callable[..., Any],
) -> dict[str, int]:  # fmt: skip
    """Export the prepared scene to `file`; `write` is Blender's exporter, with values that differ from its usual ones.

    Returns the numbers of objects and materials that were exported, rather than taken from earlier exports.
    """
    kept = KEPT.setdefault((scene.name, view_layer), Kept())
    # A view layer takes notice of objects that have come and gone where one becomes active.
    with contextlib.suppress(RuntimeError):
        bpy.context.view_layer.objects.active = next(iter(scene.objects), None)
    objects = {obj.name: obj for obj in bpy.context.view_layer.objects}
    fingerprints = {name: _prepared_fingerprint(obj, shapes, found, prototypes) for name, obj in objects.items()}
    looks = {material.name: _of_material(material) for material in bpy.data.materials}
    if _clash(objects) or _clash(looks):
        # Names that are one identifier in USD: the exporter tells them apart in one export only.
        KEPT.pop((scene.name, view_layer))
        write(filepath=str(file))
        return {"objects": len(objects), "materials": len(looks)}
    kept.objects = {name: one for name, one in kept.objects.items() if name in objects}
    changed = [name for name, fingerprint in fingerprints.items()
               if name not in kept.objects or fingerprint is None or kept.objects[name].fingerprint != fingerprint]  # fmt: skip
    if changed:
        part = file.with_name("objects.usdc")
        is_whole = len(changed) == len(objects) or not _select({objects[name] for name in changed})
        changed = list(objects) if is_whole else changed
        write(
            filepath=str(part),
            selected_objects_only=not is_whole,
            generate_preview_surface=False,
            generate_materialx_network=False,
        )
        layer = Sdf.Layer.FindOrOpen(str(part))
        paths = _paths_by_name(layer)
        for name in changed:
            kept.objects[name] = Exported(fingerprints[name], layer, paths.get(name))
    used = _bound(kept.objects.values(), scene)
    new = [name for name in used if name not in kept.materials or kept.materials[name].fingerprint != looks[name]]
    if new:
        _export_materials(kept, new, looks, file.with_name("materials.usdc"), write)
    _compose(kept, used, file, shapes)
    return {"objects": len(changed), "materials": len(new)}


def places(scene: Any, paths: dict[str, Sdf.Path], shapes: Shapes, found: Found) -> dict[str, dict[str, Any]]:
    """Return where the transforms are of objects that nothing else follows: a move of these needs no export."""
    followed = {prototype.source.name for prototype in found.prototypes.values() if prototype.source is not None}
    names = {path: name for name, path in paths.items()}
    placed = {}
    for obj in scene.objects:
        path, is_known = paths.get(obj.name), shapes.fingerprints.get(obj.name) is not None
        if path is None or not is_known or obj.name in followed | found.instancers | found.shapes.keys():
            continue
        parent = names.get(path.GetParentPath())
        if obj.name in shapes.worlds and (parent is None or parent in shapes.worlds):
            placed[obj.name] = {"kind": "object", "path": str(path), "parent": parent}
    return placed


def _prepared_fingerprint(obj: Any, shapes: Shapes, found: Found, prototypes: dict[str, Prototype]) -> str | None:
    """Return the fingerprint of an object of the prepared scene, whose shape may be another one's."""
    name = obj.name
    if name in prototypes:
        prototype = prototypes[name]
        return _of_mesh(prototype.mesh) if prototype.mesh is not None else shapes.fingerprints.get(prototype.source.name)
    if found.shapes.get(name) is not None:
        return _of_mesh(found.shapes[name])
    return shapes.fingerprints.get(name, "hidden" if obj.hide_render else None)


def _clash(names: Iterable[str]) -> bool:
    made = [_identifier(name) for name in names]
    return len(set(made)) < len(made)


def _identifier(name: str) -> str:
    return "".join(c if c.isalnum() and (k or not c.isdigit()) else "_" for k, c in enumerate(name))


def _select(chosen: set[Any]) -> bool:
    """Select objects, which takes that they are not hidden; returns whether all of them are selected."""
    for layer in _layers(bpy.context.view_layer.layer_collection):
        layer.hide_viewport = layer.collection.hide_viewport = layer.collection.hide_select = False
    for obj in bpy.context.view_layer.objects:
        if obj in chosen:
            obj.hide_viewport = obj.hide_select = False
            obj.hide_set(False)
        obj.select_set(obj in chosen)
    return all(obj.select_get() for obj in chosen)


def _layers(layer: Any) -> Iterable[Any]:
    yield layer
    for child in layer.children:
        yield from _layers(child)


def _paths_by_name(layer: Any) -> dict[str, Sdf.Path]:
    found = {}

    def visit(path: Sdf.Path) -> None:
        if path.IsPrimPropertyPath() and path.name == NAMED:
            found.setdefault(layer.GetAttributeAtPath(path).default, path.GetPrimPath())

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    return found


def _bound(objects: Iterable[Exported], scene: Any) -> list[str]:
    """Return the names of materials that exported prims are bound to, and of those of hair."""
    targets: set[Sdf.Path] = set()
    for one in objects:
        if one.path is None:
            continue

        def visit(path: Sdf.Path, one: Exported = one) -> None:
            if path.IsPrimPropertyPath() and path.name.startswith("material:binding"):
                targets.update(one.layer.GetRelationshipAtPath(path).targetPathList.explicitItems)

        one.layer.Traverse(one.path, visit)
    paths = {MATERIALS.AppendChild(_identifier(material.name)): material.name for material in bpy.data.materials}
    return sorted(paths[target] for target in targets if target in paths)


def _export_materials(kept: Kept, names: list[str], looks: dict[str, str], file: Path, write: Callable[..., Any]) -> None:
    """Export materials on a quadrangle each, which has the texture coordinates of the first mesh that uses it."""
    coordinates: dict[str, str] = {}
    for mesh in sorted(bpy.data.meshes, key=lambda mesh: mesh.name):
        for material in mesh.materials:
            if material is not None and mesh.uv_layers.active is not None:
                coordinates.setdefault(material.name, mesh.uv_layers.active.name)
    stage = bpy.data.scenes.new("primray materials")
    made = []
    for number, name in enumerate(names):
        mesh = bpy.data.meshes.new(f"primray_material_{number}")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
        if name in coordinates:
            mesh.uv_layers.new(name=coordinates[name])
        mesh.materials.append(bpy.data.materials[name])
        obj = bpy.data.objects.new(mesh.name, mesh)
        stage.collection.objects.link(obj)
        made.append(mesh)
    with bpy.context.temp_override(scene=stage, view_layer=stage.view_layers[0]):
        write(filepath=str(file))
    bpy.data.scenes.remove(stage)
    for mesh in made:
        bpy.data.meshes.remove(mesh)
    layer = Sdf.Layer.FindOrOpen(str(file))
    for name in names:
        path = MATERIALS.AppendChild(_identifier(name))
        kept.materials[name] = Exported(looks[name], layer, path if layer.GetPrimAtPath(path) else None)


def _compose(kept: Kept, materials: list[str], file: Path, shapes: Shapes) -> None:
    """Write one layer with what has been exported now and earlier."""
    composed = Sdf.Layer.CreateNew(str(file))
    placed: dict[Sdf.Path, str] = {}
    for name in sorted(kept.objects):
        one = kept.objects[name]
        if one.path is None:
            continue
        for path in one.path.GetPrefixes():
            if composed.GetPrimAtPath(path) is None:
                _copy_prim(one.layer, path, composed)
        _copy_below(one.layer, one.path, composed)
        placed[one.path] = name
    for name in materials:
        one = kept.materials[name]
        if one.path is not None:
            if composed.GetPrimAtPath(MATERIALS) is None:
                _copy_prim(one.layer, MATERIALS, composed)
            Sdf.CopySpec(one.layer, one.path, composed, one.path)
    _place(composed, shapes)
    # Images that were written beside the stage go where it goes.
    beside = f"{file.parent}/"
    UsdUtils.ModifyAssetPaths(composed, lambda path: f"./{path[len(beside) :]}" if path.startswith(beside) else path)
    composed.Save()


def _copy_prim(source: Any, path: Sdf.Path, target: Any) -> None:
    """Copy a prim without its children, the parent of which is there."""
    spec = source.GetPrimAtPath(path)
    made = Sdf.CreatePrimInLayer(target, path)
    made.specifier, made.typeName = spec.specifier, spec.typeName
    for key in spec.ListInfoKeys():
        if key not in ("specifier", "typeName"):
            made.SetInfo(key, spec.GetInfo(key))
    for property_spec in spec.properties:
        Sdf.CopySpec(source, property_spec.path, target, property_spec.path)


def _copy_below(source: Any, path: Sdf.Path, target: Any) -> None:
    """Copy an object's prim and its data, without the objects below it."""
    _copy_prim(source, path, target)
    for child in source.GetPrimAtPath(path).nameChildren:
        if NAMED not in child.properties:
            Sdf.CopySpec(source, child.path, target, child.path)


def _place(layer: Any, shapes: Shapes) -> None:
    """Write the places of objects as they are now."""
    for name, path in _paths_by_name(layer).items():
        above = layer.GetPrimAtPath(path.GetParentPath())
        parent = above.properties[NAMED].default if NAMED in above.properties else None
        rows = local_rows(shapes.worlds.get(name), None if parent is None else shapes.worlds.get(parent), parent is not None)
        attribute = layer.GetAttributeAtPath(path.AppendProperty("xformOp:transform"))
        if rows is not None and attribute is not None:
            attribute.default = Gf.Matrix4d(rows)


class _Hash:
    """A hash of anything that is written to it."""

    def __init__(self) -> None:
        self._hash = hashlib.blake2b(digest_size=16)

    def add(self, *values: Any) -> None:
        self._hash.update(repr(values).encode())

    def add_array(self, values: np.ndarray) -> None:
        self._hash.update(np.ascontiguousarray(values).data)

    def text(self) -> str:
        return self._hash.hexdigest()


def _of_mesh(mesh: Any) -> str:
    hashed = _Hash()
    hashed.add(mesh.name, len(mesh.vertices), len(mesh.edges), len(mesh.polygons), len(mesh.loops))
    hashed.add([None if material is None else material.name for material in mesh.materials])
    hashed.add(mesh.uv_layers.active.name if mesh.uv_layers.active else "", mesh.color_attributes.render_color_index)
    hashed.add(*_own_properties(mesh))
    starts = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    hashed.add_array(starts)
    for name, values, width, kind in (
        ("co", mesh.vertices, 3, np.float32), ("vertex_index", mesh.loops, 1, np.int32),
        ("vector", mesh.corner_normals, 3, np.float32),
    ):  # fmt: skip
        array = np.empty(len(values) * width, kind)
        values.foreach_get(name, array)
        hashed.add_array(array)
    for attribute in mesh.attributes:
        hashed.add(attribute.name, attribute.domain, attribute.data_type)
        if attribute.data_type in MEMBERS and attribute.name not in ("position", ".corner_vert"):
            name, kind, width = MEMBERS[attribute.data_type]
            array = np.empty(len(attribute.data) * width, kind)
            attribute.data.foreach_get(name, array)
            hashed.add_array(array)
    return hashed.text()


def _of_object(obj: Any) -> str | None:
    """Return the fingerprint of an evaluated object, None where it is not known what its export depends on."""
    original = obj.original
    if obj.type not in ("MESH", *PLACES) or len(original.particle_systems):
        return None
    hashed = _Hash()
    hashed.add(original.name, obj.type, original.parent.name if original.parent else "")
    hashed.add([(slot.link, slot.material.name if slot.material else "") for slot in original.material_slots])
    hashed.add(*_own_properties(original))
    if obj.type == "MESH":
        hashed.add(original.data.name, _of_mesh(obj.data))
        if len(original.modifiers):
            # Surfaces that are subdivided last are exported before that.
            hashed.add(_of_mesh(original.data))
            for modifier in original.modifiers:
                _add_rna(hashed, modifier, set())
    return hashed.text()


def _of_material(material: Any) -> str:
    hashed = _Hash()
    _add_rna(hashed, material, set())
    hashed.add(*_own_properties(material))
    return hashed.text()


def _own_properties(owner: Any) -> list[tuple[str, str]]:
    return [(key, repr(_plain(value))) for key, value in owner.items()]


def _plain(value: Any) -> Any:
    for name in ("to_dict", "to_list"):
        if hasattr(value, name):
            return getattr(value, name)()
    return value


@cache
def _properties(kind: Any) -> list[tuple[str, Any]]:
    """Return the properties of a type of Blender's data that are hashed."""
    if issubclass(kind, bpy.types.NodeSocket):
        names = {"identifier", "default_value", "enabled"}
    elif issubclass(kind, bpy.types.Image):
        names = set(IMAGE)
    else:
        others = NODE_SHOWN if issubclass(kind, bpy.types.Node) else set()
        names = set(kind.bl_rna.properties.keys()) - SHOWN - others
    return [(item.identifier, item) for item in kind.bl_rna.properties if item.identifier in names]


def _add_rna(hashed: _Hash, owner: Any, seen: set[int]) -> None:
    """Add the values of a piece of data and of what belongs to it: of other data-blocks the names, of trees and images more."""
    # A first member may be where its owner is.
    key = hash((owner.as_pointer(), owner.bl_rna.identifier))
    if key in seen:
        return
    seen.add(key)
    hashed.add(owner.bl_rna.identifier)
    for name, item in _properties(type(owner)):
        try:
            value = getattr(owner, name)
        except (AttributeError, TypeError, ValueError):
            continue
        if item.type == "POINTER":
            _add_pointer(hashed, name, value, item, seen)
        elif item.type == "COLLECTION":
            hashed.add(name, len(value))
            for part in value:
                _add_pointer(hashed, name, part, item, seen)
        elif getattr(item, "is_array", False):
            hashed.add(name, [tuple(row) if hasattr(row, "__len__") else row for row in value])
        else:
            hashed.add(name, value)
    if isinstance(owner, bpy.types.NodeTree):
        for link in owner.links:
            hashed.add(
                link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier, link.is_muted
            )


def _add_pointer(hashed: _Hash, name: str, value: Any, item: Any, seen: set[int]) -> None:
    if value is None:
        hashed.add(name, None)
    elif _is_elsewhere(value, item):
        hashed.add(name, value.name)
    else:
        _add_rna(hashed, value, seen)


def _is_elsewhere(value: Any, item: Any) -> bool:
    """Return whether what a property points to is hashed where it belongs, if at all."""
    if isinstance(value, bpy.types.ID):
        return not isinstance(value, (bpy.types.NodeTree, bpy.types.Image))
    return isinstance(value, (bpy.types.Node, bpy.types.NodeSocket)) and item.type == "POINTER"
