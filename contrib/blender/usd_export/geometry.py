# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes made ready for Blender's exporter, and instances, which it would write as copies.

The scene is a copy in a process of its own: what is changed here changes nothing of the user's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from .lights import light_group

Note = Callable[[str, str, str], None]
MATERIAL_MODIFIERS = ("NODES", "SOLIDIFY", "BEVEL", "BOOLEAN")  # they can give faces other materials
SURFACES = ("MESH", "CURVE", "SURFACE", "FONT", "META")


@dataclass
class Prototype:
    """What is instanced: an object of the scene or a mesh made for it, and where it is."""

    name: str
    mesh: Any = None
    source: Any = None  # an object to copy
    matrices: list[Any] = field(default_factory=list)
    ids: list[int] = field(default_factory=list)


@dataclass
class Found:
    """What one evaluated scene has beside what Blender's exporter writes by itself."""

    lamps: list[tuple[Any, ...]] = field(default_factory=list)
    prototypes: dict[Any, Prototype] = field(default_factory=dict)
    instancers: set[str] = field(default_factory=set)
    shapes: dict[str, Any] = field(default_factory=dict)  # meshes that replace objects, by name; None: nothing is drawn


def find_instances(depsgraph: Any, found: Found, note: Note) -> None:
    """Group instances by what is instanced, and convert shapes that the exporter writes otherwise than Blender draws them."""
    for instance in depsgraph.object_instances:
        obj = instance.object
        if instance.is_instance:
            if instance.parent is not None:
                found.instancers.add(instance.parent.original.name)
            if obj.type in ("EMPTY", "LIGHT", "CAMERA"):
                continue
            _add_instance(instance, obj, found, depsgraph)
        elif obj.type == "CURVE":
            found.shapes[obj.original.name] = _mesh_of(obj, depsgraph)
        elif obj.type == "POINTCLOUD" and "radius" not in obj.data.attributes:
            # Blender 5.0 ends itself at a point cloud without radii.
            found.shapes[obj.original.name] = None
            note("points", obj.original.name, "a point cloud without radii is not exported")
    for name in found.instancers:
        obj = bpy.data.objects.get(name)
        if obj is not None and obj.type in SURFACES and name not in found.shapes and _is_generator(obj):
            found.shapes[name] = _mesh_of(obj.evaluated_get(depsgraph), depsgraph)


def _is_generator(obj: Any) -> bool:
    return any(modifier.type == "NODES" for modifier in obj.modifiers)


def _add_instance(instance: Any, obj: Any, found: Found, depsgraph: Any) -> None:
    original = obj.original
    # Geometry that nodes have made is handed out under the name of the object whose nodes these are.
    is_made = instance.instance_object is not None and instance.parent is not None and obj.type == "MESH"
    is_made = is_made and instance.instance_object.original == instance.parent.original
    key = ("made", obj.data.as_pointer()) if is_made else ("object", original.name)
    prototype = found.prototypes.get(key)
    if prototype is None:
        prototype = found.prototypes[key] = Prototype(obj.name)
        if is_made:
            prototype.mesh = obj.data.copy()
        elif obj.type == "CURVE" or (obj.type in SURFACES and _is_generator(original)):
            prototype.mesh = _mesh_of(obj, depsgraph)
        else:
            prototype.source = original
    prototype.matrices.append(instance.matrix_world.copy())
    prototype.ids.append(hash(tuple(instance.persistent_id)) & 0x7FFFFFFFFFFFFFFF)


def _mesh_of(obj: Any, depsgraph: Any) -> Any:
    """Return a new mesh of an evaluated object's surface, or None if it has no face."""
    try:
        mesh = bpy.data.meshes.new_from_object(obj, preserve_all_data_layers=True, depsgraph=depsgraph)
    except RuntimeError:
        return None
    if len(mesh.polygons) == 0:
        bpy.data.meshes.remove(mesh)
        return None
    return mesh


def prepare_scene(scene: Any, found: Found) -> dict[str, Prototype]:
    """Replace converted shapes, end instancing, and place one object for each prototype.

    Returns these by their objects' names.
    """
    for name, mesh in found.shapes.items():
        obj = bpy.data.objects.get(name)
        if obj is None:
            continue
        if mesh is None and obj.type != "MESH":
            bpy.data.objects.remove(obj)
        elif mesh is not None:
            _replace(obj, mesh)
    for name in found.instancers:
        obj = bpy.data.objects.get(name)
        if obj is None:
            continue
        obj.instance_type = "NONE"
        if name in found.shapes and found.shapes[name] is None and obj.type == "MESH":
            bpy.data.objects.remove(obj)
            continue
        for system in obj.particle_systems:
            if system.settings.render_type in ("OBJECT", "COLLECTION"):
                system.settings.render_type = "NONE"
    names = {}
    for number, prototype in enumerate(p for p in found.prototypes.values() if p.mesh or p.source):
        obj = bpy.data.objects.new(prototype.name, prototype.mesh) if prototype.mesh else prototype.source.copy()
        if prototype.source is not None:
            obj.parent = None
            obj.constraints.clear()
            obj.animation_data_clear()
        obj.name = f"primray_prototype_{number}"
        obj.instance_type = "NONE"
        obj.hide_render = obj.hide_viewport = False
        obj.matrix_world = Matrix.Identity(4)
        obj.delta_location, obj.delta_rotation_euler, obj.delta_scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
        scene.collection.objects.link(obj)
        names[obj.name] = prototype
    return names


def repair_slots() -> None:
    """Give surfaces without a material what Blender renders them with, and meshes of one material that one.

    The exporter takes the first slot's where all faces have one material, whichever it is.
    """
    default = None
    for data in [*bpy.data.meshes, *bpy.data.curves, *bpy.data.metaballs]:
        if data.library is None and (not data.materials or None in list(data.materials)):
            default = default or _default_material()
            if not data.materials:
                data.materials.append(default)
            for slot, material in enumerate(data.materials):
                if material is None:
                    data.materials[slot] = default
    for obj in bpy.data.objects:
        for slot in obj.material_slots:
            if slot.material is None and obj.library is None:
                slot.material = default = default or _default_material()
        if obj.type == "MESH" and len(obj.material_slots) > 1 and not any(m.type in MATERIAL_MODIFIERS for m in obj.modifiers):
            used = np.zeros(len(obj.data.polygons), np.int32)
            obj.data.polygons.foreach_get("material_index", used)
            used = np.unique(np.minimum(used, len(obj.material_slots) - 1))
            if len(used) == 1:
                obj.material_slots[0].material = obj.material_slots[int(used[0])].material


def _default_material() -> Any:
    """Return a Diffuse BSDF of a grey of 0.8, which Blender calls default_surface."""
    material = bpy.data.materials.new("default_surface")
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (0.8, 0.8, 0.8, 1)
    shader.inputs["Specular IOR Level"].default_value = 0.0
    return material


def group_glowing_meshes(stage: Usd.Stage, prims: dict[str, Sdf.Path]) -> None:
    """Make meshes of objects that are in a light group lights of that group; their materials' emission is the light."""
    for obj in bpy.data.objects:
        if not obj.lightgroup or obj.type == "LIGHT" or obj.name not in prims or not _glows(obj):
            continue
        for prim in Usd.PrimRange(stage.GetPrimAtPath(prims[obj.name])):
            if prim.IsA(UsdGeom.Mesh):
                light = UsdLux.LightAPI(UsdLux.MeshLightAPI.Apply(prim).GetPrim())
                light.CreateIntensityAttr(1.0)
                light.CreateNormalizeAttr(False)
                light.CreateMaterialSyncModeAttr(UsdLux.Tokens.materialGlowTintsLight)
                light_group(prim, obj.lightgroup)


def _glows(obj: Any) -> bool:
    trees = [slot.material.node_tree for slot in obj.material_slots if slot.material and slot.material.node_tree]
    for node in (node for tree in trees for node in tree.nodes):
        strength = node.inputs.get("Emission Strength" if node.type == "BSDF_PRINCIPLED" else "Strength")
        if node.type in ("BSDF_PRINCIPLED", "EMISSION") and (strength.is_linked or strength.default_value > 0):
            return True
    return False


def _replace(obj: Any, mesh: Any) -> None:
    """Let a mesh take the place of an object, under the object's name."""
    if obj.type == "MESH":
        obj.modifiers.clear()
        obj.data = mesh
        return
    name, matrix, collections = obj.name, obj.matrix_world.copy(), list(obj.users_collection)
    for child in obj.children:
        placed = child.matrix_world.copy()
        child.parent = None
        child.matrix_world = placed
    bpy.data.objects.remove(obj)
    new = bpy.data.objects.new(name, mesh)
    new.matrix_world = matrix
    for collection in collections:
        collection.objects.link(new)


def write_instances(stage: Usd.Stage, scope: str, prims: dict[str, Sdf.Path], names: dict[str, Prototype]) -> None:
    """Write a point instancer for each prototype, whose prim the exporter has written."""
    for number, (name, prototype) in enumerate(names.items()):
        if name not in prims:
            continue
        instancer = UsdGeom.PointInstancer.Define(stage, f"{scope}/instances_{number}")
        instancer.GetPrim().SetMetadata("displayName", prototype.name)
        source = prims[name]
        # A prototype is drawn by its instancer alone: it is below it by reference, and the exported prim is no more.
        target = stage.DefinePrim(instancer.GetPath().AppendChild("prototype"))
        target.GetReferences().AddInternalReference(source)
        stage.OverridePrim(source).SetSpecifier(Sdf.SpecifierOver)
        stage.GetPrimAtPath(source).GetAttribute("visibility")
        UsdGeom.Imageable(stage.OverridePrim(source)).CreateVisibilityAttr(UsdGeom.Tokens.invisible)
        UsdGeom.Imageable(target).CreateVisibilityAttr(UsdGeom.Tokens.inherited)
        instancer.CreatePrototypesRel().SetTargets([target.GetPath()])
        places = [matrix.decompose() for matrix in prototype.matrices]
        instancer.CreateProtoIndicesAttr(Vt.IntArray(len(places), 0))
        instancer.CreatePositionsAttr(Vt.Vec3fArray([Gf.Vec3f(*location) for location, _, _ in places]))
        turns = [Gf.Quatf(q.w, q.x, q.y, q.z) for _, q, _ in places]
        # A half's turns are off by a thousandth: newer USD has float ones.
        if hasattr(instancer, "CreateOrientationsfAttr"):
            instancer.CreateOrientationsfAttr(Vt.QuatfArray(turns))
        else:
            instancer.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(q) for q in turns]))
        instancer.CreateScalesAttr(Vt.Vec3fArray([Gf.Vec3f(*scale) for _, _, scale in places]))
        instancer.CreateIdsAttr(Vt.Int64Array(prototype.ids))


def prims_by_object(stage: Usd.Stage) -> dict[str, Sdf.Path]:
    """Return the exported prims by the names of their objects."""
    found = {}
    for prim in stage.Traverse():
        name = prim.GetAttribute("userProperties:blender:object_name").Get()
        if name is not None:
            found.setdefault(name, prim.GetPath())
    return found


def blender_names(stage: Usd.Stage, prototypes: dict[str, Prototype]) -> dict[str, dict[str, str]]:
    """Return the names of objects and materials by the paths of their prims, and those of topmost parents by objects."""
    objects, materials, assets = {}, {}, {}
    for prim in stage.Traverse():
        if prim.IsA(UsdShade.Material):
            materials[str(prim.GetPath())] = prim.GetAttribute("userProperties:blender:data_name").Get() or prim.GetName()
        elif (name := prim.GetAttribute("userProperties:blender:object_name").Get()) is not None:
            objects[str(prim.GetPath())] = prototypes[name].name if name in prototypes else name
        elif prim.GetMetadata("displayName"):
            objects[str(prim.GetPath())] = prim.GetMetadata("displayName")
    for name in set(objects.values()):
        top = bpy.data.objects.get(name)
        while top is not None and top.parent is not None:
            top = top.parent
            assets[name] = top.name
    return {"objects": objects, "materials": materials, "assets": assets}


@dataclass(frozen=True)
class Hair:
    """Radii at root and tip in scene units, how they change between the two, and the material of a particle system's hair."""

    root: float = 0.01
    tip: float = 0.0
    shape: float = 0.0
    closes: bool = False
    look: str = ""

    def radius(self, along: float) -> float:
        """Return the radius at a share of the way from the root to the tip (Cycles, shaperadius)."""
        if along >= 1 and self.closes:
            return 0.0
        power = 1 + self.shape if self.shape < 0 else 1 / max(1 - self.shape, 1e-6)
        return self.tip + (self.root - self.tip) * (1 - along) ** power


def repair_hair(stage: Usd.Stage, layer_stage: Usd.Stage, systems: dict[str, Hair], note: Note) -> None:
    """Give curves of particle systems, which the exporter writes without widths and material, those of their systems."""
    materials = {prim.GetName(): prim for prim in stage.Traverse() if prim.IsA(UsdShade.Material)}
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.BasisCurves) or UsdGeom.BasisCurves(prim).GetWidthsAttr().HasAuthoredValue():
            continue
        curves = UsdGeom.BasisCurves(prim)
        counts = np.asarray(curves.GetCurveVertexCountsAttr().Get() or [], int)
        owners = [str(prim.GetPath())] + [str(path) for path in prim.GetPath().GetPrefixes()]
        found = next((systems[name] for name in systems if any(_names(path, name) for path in owners)), Hair())
        look = found.look
        widths = [2 * found.radius(k / max(count - 1, 1)) for count in counts for k in range(count)]
        over = UsdGeom.BasisCurves(layer_stage.OverridePrim(prim.GetPath()))
        over.CreateWidthsAttr(Vt.FloatArray(widths))
        over.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
        material = materials.get(_identifier(look))
        if look and material is None:
            note("hair-material", look, "the material of hair on an object that is not rendered is not exported")
        elif material is not None and not UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]:
            UsdShade.MaterialBindingAPI.Apply(over.GetPrim()).Bind(UsdShade.Material(material))
        # Cycles' strands go through all their keys. The exporter writes straight pieces, and in Blender 4.5 a B-spline, which
        # leaves out the first and the last piece.
        over.CreateTypeAttr(UsdGeom.Tokens.cubic)
        over.CreateBasisAttr(UsdGeom.Tokens.catmullRom)
        over.CreateWrapAttr(UsdGeom.Tokens.pinned)


def _names(path: str, name: str) -> bool:
    return path.rpartition("/")[2] == _identifier(name)


def _identifier(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)
