"""Runs inside Blender: makes scenes, renders them by the add-on and by Cycles, and says a row of JSON for each.

python scenes.py JOB JSON
"""

from __future__ import annotations

import json
import math
import shutil
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

MODULE = "bl_ext.user_default.primray"


def say(**row):
    print(f"\nrow: {json.dumps(row)}", flush=True)


def install(asked):
    bpy.ops.extensions.package_install_files(filepath=asked["zip"], repo="user_default", enable_on_install=True)
    bpy.context.preferences.addons[MODULE].preferences.python = asked["python"]


def kept():
    return sys.modules[f"{MODULE}.engine"].KEPT


def empty(size=32, samples=64):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    for material in list(bpy.data.materials):
        bpy.data.materials.remove(material)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.primray.samples, scene.primray.seed = samples, 3
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 4 * samples, False, False
    scene.cycles.sample_clamp_indirect, scene.cycles.blur_glossy = 0, 0
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 16
    scene.cycles.volume_bounces = scene.cycles.transmission_bounces = scene.cycles.transparent_max_bounces = 16
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.world = bpy.data.worlds.new("World")
    world((0, 0, 0))
    return scene


def world(color, strength=1.0):
    node = tree_of(bpy.context.scene.world).nodes["Background"]
    node.inputs["Color"].default_value = (*color, 1)
    node.inputs["Strength"].default_value = strength
    return node


def tree_of(owner):
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree


def material(name="matte", **values):
    found = bpy.data.materials.new(name)
    node = tree_of(found).nodes["Principled BSDF"]
    for socket, value in values.items():
        node.inputs[socket.replace("_", " ")].default_value = value
    return found


def matte():
    return material(Base_Color=(0.5, 0.5, 0.5, 1), Roughness=1.0, Specular_IOR_Level=0.0)


def add(name, data, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1)):
    obj = bpy.data.objects.new(name, data)
    obj.location, obj.rotation_euler, obj.scale = location, rotation, scale
    bpy.context.scene.collection.objects.link(obj)
    return obj


def lamp(kind, energy=100.0, **values):
    data = bpy.data.lights.new(kind, kind)
    data.energy = energy
    if kind in ("POINT", "SPOT"):
        data.use_soft_falloff = False
    for name, value in values.items():
        setattr(data, name, value)
    return data


def camera(location=(0, 0, 6), rotation=(0, 0, 0), **values):
    data = bpy.data.cameras.new("Camera")
    for name, value in values.items():
        setattr(data, name, value)
    bpy.context.scene.camera = add("Camera", data, location, rotation)
    return bpy.context.scene.camera


def floor(look=None):
    bpy.ops.mesh.primitive_plane_add(size=8)
    bpy.context.object.data.materials.append(look or matte())
    return bpy.context.object


def render(engine, file):
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    return str(file)


def both(name, folder, **more):
    """Render a scene by both engines; what goes wrong is said in the scene's row."""
    try:
        ours, theirs = render("PRIMRAY", f"{folder}/{name}.primray.exr"), render("CYCLES", f"{folder}/{name}.cycles.exr")
        say(name=name, ours=ours, theirs=theirs, notes=kept().notes, **more)
    except Exception as error:
        traceback.print_exc()
        say(name=name, error=str(error))


LAMPS = {
    "point": lambda: add("L", lamp("POINT", shadow_soft_size=0.2), (0.5, 0.3, 2)),
    "point of no size": lambda: add("L", lamp("POINT", shadow_soft_size=0.0), (0.5, 0.3, 2)),
    "point, scaled": lambda: add("L", lamp("POINT", shadow_soft_size=0.2), (0.5, 0.3, 2), scale=(3, 3, 3)),
    "coloured": lambda: add("L", lamp("POINT", color=(1.0, 0.5, 0.2)), (0, 0, 2)),
    "square": lambda: add("L", lamp("AREA", size=1.0), (0, 0, 2)),
    "rectangle, turned": lambda: add("L", lamp("AREA", shape="RECTANGLE", size=2.0, size_y=0.5), (1, 0, 2), (0.3, 0.5, 0.7)),
    "disk, scaled": lambda: add("L", lamp("AREA", shape="DISK", size=1.0), (0, 0, 2), scale=(2, 2, 2)),
    "ellipse": lambda: add("L", lamp("AREA", shape="ELLIPSE", size=2.0, size_y=0.7), (0, 0, 1.5)),
    "spread": lambda: add("L", lamp("AREA", size=0.5, spread=math.radians(60)), (0, 0, 2)),
    "sun": lambda: add("L", lamp("SUN", 3.0, angle=math.radians(10)), (0, 0, 2), (0.6, 0.2, 0)),
    "spot, hard": lambda: add("L", lamp("SPOT", spot_size=1.0, spot_blend=0.0, shadow_soft_size=0.0), (0, 0, 3)),
    "spot, soft": lambda: add("L", lamp("SPOT", spot_size=1.2, spot_blend=0.6, shadow_soft_size=0.0), (0, 0, 3)),
}


def lamps(asked):
    for name, place in LAMPS.items():
        empty()
        floor()
        camera(type="ORTHO", ortho_scale=4.0)
        place()
        both(name, asked["folder"])


def environment_image(size=(64, 32)):
    """A lat-long image with another colour in each direction."""
    width, height = size
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    pixels = []
    for y in range(height):
        for x in range(width):
            pixels += [0.2 + 0.8 * (x < width // 4), 0.3 + (x // 8) / 10, 0.2 + 0.8 * y / height, 1.0]
    image.pixels.foreach_set(pixels)
    image.pack()
    return image


def linked_world(rotation=None, strength=1.0):
    node = world((1, 1, 1), strength)
    tree = bpy.context.scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = environment_image()
    tree.links.new(texture.outputs["Color"], node.inputs["Color"])
    if rotation is not None:
        mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
        mapping.inputs["Rotation"].default_value = rotation
        tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    return node


def mixed_world():
    node = linked_world()
    tree = bpy.context.scene.world.node_tree
    mix = tree.nodes.new("ShaderNodeGamma")
    mix.inputs["Gamma"].default_value = 2.0
    tree.links.new(node.inputs["Color"].links[0].from_socket, mix.inputs["Color"])
    tree.links.new(mix.outputs["Color"], node.inputs["Color"])


WORLDS = {
    "constant": lambda: world((0.2, 0.5, 0.9), 3.0),
    "image": lambda: linked_world(),
    "image, strong": lambda: linked_world(strength=2.0),
    "image, turned": lambda: linked_world((0, 0, 1.0)),
    "image, tilted": lambda: linked_world((0.4, 0.3, 1.0)),
    "other nodes": mixed_world,
}


def worlds(asked):
    for name, make in WORLDS.items():
        empty()
        floor()
        bpy.context.object.scale = (0.2, 0.2, 0.2)
        camera((0, -4, 1.5), (math.radians(80), 0, 0.3), lens=18.0)
        make()
        both(name, asked["folder"])


CAMERAS: dict[str, dict[str, Any]] = {
    "perspective": {},
    "shifted": {"shift_x": 0.1, "shift_y": -0.2},
    "portrait": {"sensor_fit": "VERTICAL"},
    "orthographic": {"type": "ORTHO", "ortho_scale": 5.0, "shift_x": 0.1},
    "equirectangular": {"type": "PANO", "panorama_type": "EQUIRECTANGULAR"},
    "fisheye": {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": 2.5},
    "equisolid": {"type": "PANO", "panorama_type": "FISHEYE_EQUISOLID", "fisheye_fov": 2.5, "fisheye_lens": 15.0},
}


def cameras(asked):
    for name, values in CAMERAS.items():
        scene = empty(48)
        scene.render.resolution_y = 32
        bpy.ops.mesh.primitive_cube_add(size=1, location=(0.5, 0.2, 0.3), rotation=(0.3, 0.2, 0.4))
        bpy.context.object.data.materials.append(matte())
        world((0.5, 0.5, 0.5))
        lamp_object = add("L", lamp("SUN", 2.0), (0, 0, 2), (0.6, 0.2, 0))
        assert lamp_object is not None
        camera((0, -4, 1), (math.radians(75), 0, 0.1), **values)
        both(name, asked["folder"])


SURFACES: dict[str, dict[str, Any]] = {
    "default": {},
    "rough": {"Roughness": 1.0},
    "metal": {"Metallic": 1.0, "Base_Color": (0.9, 0.6, 0.3, 1), "Roughness": 0.4},
    "specular level": {"Specular_IOR_Level": 1.0},
    "alpha": {"Alpha": 0.4},
    "sheen": {"Sheen_Weight": 1.0},
    "emission": {"Emission_Color": (0.2, 0.5, 1.0, 1), "Emission_Strength": 2.0},
    "coat": {"Coat_Weight": 1.0, "Base_Color": (0.5, 0.2, 0.1, 1)},
    "transmission": {"Transmission_Weight": 1.0, "Roughness": 0.0, "Base_Color": (0.7, 0.9, 0.6, 1)},
    "anisotropic": {"Metallic": 1.0, "Anisotropic": 0.8, "Roughness": 0.4},
    "anisotropic, turned": {"Metallic": 1.0, "Anisotropic": 0.8, "Roughness": 0.4, "Anisotropic_Rotation": 0.25},
    "subsurface": {"Subsurface_Weight": 1.0, "Subsurface_Scale": 0.05},
}


def ball(look):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=1.0)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(look)


def surfaces(asked):
    for name, values in SURFACES.items():
        empty(24, samples=512 if name == "transmission" else 128)  # light that glass gathers is noisier
        look = material(**({"Base_Color": (0.6, 0.5, 0.4, 1)} | values))
        ball(look)
        studio()
        both(name, asked["folder"])


def studio():
    world((0.3, 0.3, 0.3))
    add("L", lamp("AREA", 200.0, size=2.0), (2, -2, 3), (math.radians(45), 0, math.radians(45)))
    camera((0, -4, 0), (math.radians(90), 0, 0), lens=60.0)


def shader(kind, **values):
    found = bpy.data.materials.new(kind)
    tree = tree_of(found)
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    node = tree.nodes.new(kind)
    for socket, value in values.items():
        node.inputs[socket.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return found


def mixed():
    found = shader("ShaderNodeBsdfDiffuse", Color=(0.8, 0.2, 0.2, 1))
    tree = found.node_tree
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    mix.inputs[0].default_value = 0.3
    tree.links.new(tree.nodes["Diffuse BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return found


SHADERS = {
    "Diffuse BSDF": lambda: shader("ShaderNodeBsdfDiffuse", Color=(0.8, 0.4, 0.2, 1)),
    "Emission": lambda: shader("ShaderNodeEmission", Color=(0.8, 0.4, 0.2, 1), Strength=2.0),
    "Glass BSDF": lambda: shader("ShaderNodeBsdfGlass", Color=(0.9, 0.8, 0.9, 1), IOR=1.45),
    "Mix Shader with Transparent BSDF": mixed,
}


def shaders(asked):
    for name, make in SHADERS.items():
        empty(24, samples=128)
        ball(make())
        studio()
        both(name, asked["folder"])


def scattered(count=9):
    """An instancer by geometry nodes: a ball at each vertex of a grid."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=2, y_subdivisions=2, size=3, location=(0, 0, 0.2))
    grid = bpy.context.object
    grid.data.materials.append(matte())
    group = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    points, thing = group.nodes.new("GeometryNodeInstanceOnPoints"), group.nodes.new("GeometryNodeMeshIcoSphere")
    look, join = group.nodes.new("GeometryNodeSetMaterial"), group.nodes.new("GeometryNodeJoinGeometry")
    thing.inputs["Radius"].default_value = 0.3
    look.inputs["Material"].default_value = material("balls", Base_Color=(0.8, 0.1, 0.1, 1))
    links = group.links
    links.new(thing.outputs["Mesh"], look.inputs["Geometry"])
    links.new(start.outputs[0], points.inputs["Points"])
    links.new(look.outputs[0], points.inputs["Instance"])
    links.new(points.outputs[0], join.inputs[0])
    links.new(start.outputs[0], join.inputs[0])
    links.new(join.outputs[0], end.inputs[0])
    grid.modifiers.new("scatter", "NODES").node_group = group
    return grid


def collections():
    """A collection that is placed three times by empties."""
    kinds = bpy.data.collections.new("kinds")
    mesh = bpy.data.meshes.new("box")
    mesh.from_pydata(
        [(x, y, z) for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (0, 0.6)], [],
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
    )  # fmt: skip
    mesh.materials.append(material("boxes", Base_Color=(0.1, 0.3, 0.8, 1)))
    kinds.objects.link(bpy.data.objects.new("box", mesh))
    for k in range(3):
        place = add(f"place{k}", None, (1.2 * k - 1.2, 0.5, 0.1), (0, 0, 0.4 * k), (1, 1, 1 + k))
        place.instance_type, place.instance_collection = "COLLECTION", kinds


def instances(asked):
    for name, make in (("geometry nodes", scattered), ("collections", collections)):
        empty(48)
        floor()
        make()
        world((0.6, 0.6, 0.6))
        camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
        both(name, asked["folder"])


def curves(asked):
    for name, depth in (("a curve with a bevel", 0.1), ("a curve without one", 0.0)):
        empty(48)
        floor()
        data = bpy.data.curves.new("wire", "CURVE")
        data.dimensions, data.bevel_depth = "3D", depth
        data.materials.append(material("wire", Base_Color=(0.8, 0.5, 0.1, 1)))
        spline = data.splines.new("BEZIER")
        spline.bezier_points.add(1)
        for point, co in zip(spline.bezier_points, ((-1.5, 0, 0.5), (1.5, 0.5, 0.5)), strict=True):
            point.co, point.handle_left_type, point.handle_right_type = co, "AUTO", "AUTO"
        add("wire", data)
        world((0.6, 0.6, 0.6))
        camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
        both(name, asked["folder"])


def hair(asked):
    empty(24)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.7)
    furry = bpy.context.object
    furry.data.materials.append(material("fur", Base_Color=(0.7, 0.2, 0.05, 1), Roughness=0.6))
    furry.modifiers.new("hair", "PARTICLE_SYSTEM")
    settings = furry.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.root_radius = "HAIR", 2000, 0.3, 2.0
    studio()
    both("hair of particles", asked["folder"])


def multilayer(file, engine):
    image = bpy.context.scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    return render(engine, file)


def smoke_file(folder):
    """A ball of smoke that is hot in its middle, two units wide."""
    import numpy as np

    bpy.utils.expose_bundled_modules()
    import openvdb

    z, y, x = np.mgrid[:32, :32, :32] - 15.5
    ball = np.clip(1 - np.sqrt(x * x + y * y + z * z) / 16, 0, 1).astype(np.float32)
    grids = []
    for name, values in (("density", ball), ("temperature", 2500 * ball)):
        grid = openvdb.FloatGrid()
        grid.copyFromArray(values)
        grid.name, grid.gridClass = name, openvdb.GridClass.FOG_VOLUME
        place = openvdb.createLinearTransform(voxelSize=1 / 16)
        place.postTranslate((-1 + 1 / 32, -1 + 1 / 32, -1 + 1 / 32))
        grid.transform = place
        grids.append(grid)
    file = f"{folder}/smoke.vdb"
    openvdb.write(file, grids=grids)
    return file


def smoke(asked, look, location=(0, 0, 0), **values):
    data = bpy.data.volumes.new("smoke")
    data.filepath = smoke_file(asked["folder"])
    data.materials.append(look)
    return add("smoke", data, location, **values)


def volume(kind, **values):
    """A material with a volume alone."""
    found = shader(kind, **values)
    tree = found.node_tree
    tree.links.new(tree.links[0].from_socket, tree.nodes["Material Output"].inputs["Volume"])
    tree.links.remove(next(link for link in tree.links if link.to_socket.name == "Surface"))
    return found


def by_attribute():
    """A Volume Scatter whose density is the grid's, times 6."""
    found = volume("ShaderNodeVolumeScatter", Color=(0.9, 0.7, 0.5, 1), Anisotropy=0.4)
    tree = found.node_tree
    grid, times = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeMath")
    grid.attribute_name, times.operation = "density", "MULTIPLY"
    times.inputs[1].default_value = 6.0
    tree.links.new(grid.outputs["Fac"], times.inputs[0])
    tree.links.new(times.outputs[0], next(n for n in tree.nodes if n.type == "VOLUME_SCATTER").inputs["Density"])
    return found


def box(look):
    bpy.ops.mesh.primitive_cube_add(size=1.2, rotation=(0.2, 0.3, 0.4))
    bpy.context.object.data.materials.append(look)


def foggy(kind, **values):
    tree = tree_of(bpy.context.scene.world)
    node = tree.nodes.new(kind)
    for socket, value in values.items():
        node.inputs[socket.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    world((0, 0, 0))
    ball(matte())


PRINCIPLED_VOLUME = "ShaderNodeVolumePrincipled"
VOLUMES = {
    "smoke": lambda asked: smoke(asked, volume(PRINCIPLED_VOLUME, Color=(0.7, 0.5, 0.4, 1), Density=4.0, Anisotropy=0.3)),
    "smoke, scaled": lambda asked: smoke(
        asked,
        volume(PRINCIPLED_VOLUME, Density=4.0),
        (0.2, 0, 0),
        rotation=(0, 0, 0.6),
        scale=(1.5, 1.0, 1.0),
    ),
    "absorption colour": lambda asked: smoke(
        asked, volume(PRINCIPLED_VOLUME, Density=4.0, Absorption_Color=(0.8, 0.3, 0.1, 1))
    ),
    "Volume Scatter by an attribute": lambda asked: smoke(asked, by_attribute()),
    "fire": lambda asked: smoke(asked, volume(PRINCIPLED_VOLUME, Density=1.0, Blackbody_Intensity=0.5, Temperature=1.0)),
    "a mesh that absorbs": lambda asked: box(volume("ShaderNodeVolumeAbsorption", Color=(0.2, 0.5, 0.8, 1), Density=1.5)),
    "a mesh that scatters": lambda asked: box(volume(PRINCIPLED_VOLUME, Color=(0.8, 0.8, 0.8, 1), Density=1.5)),
    "the world's": lambda asked: foggy("ShaderNodeVolumeScatter", Color=(0.9, 0.9, 0.9, 1), Density=0.1),
}


def volumes(asked):
    for name, make in VOLUMES.items():
        if asked.get("only") not in (None, name):
            continue
        empty(24, samples=128)
        studio()
        make(asked)
        both(name, asked["folder"])


def moves(obj, path, *values):
    """Animate a property linearly over the frames 0, 1, 2."""
    for frame, value in enumerate(values):
        setattr(obj, path, value)
        obj.keyframe_insert(path, frame=frame)
    animation = obj.animation_data.action
    curves = animation.fcurves if hasattr(animation, "fcurves") else animation.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def cube(**values):
    bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0, 0, 0.6))
    bpy.context.object.data.materials.append(material("moving", Base_Color=(0.8, 0.3, 0.1, 1), Roughness=0.8))
    return bpy.context.object


def bent():
    """A cube whose shape changes by a shape key."""
    obj = cube()
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="taller")
    for point in key.data:
        point.co.z *= 2.5
    for frame, value in ((0, 0.0), (2, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def growing():
    """Copies of a cube that become more."""
    obj = cube()
    more = obj.modifiers.new("more", "ARRAY")
    more.relative_offset_displace = (1.2, 0, 0)
    for frame, count in ((0, 1), (1, 4), (2, 7)):
        more.count = count
        more.keyframe_insert("count", frame=frame)


def unblurred():
    obj = cube()
    moves(obj, "location", (-0.5, 0, 0.6), (0, 0, 0.6), (0.5, 0, 0.6))
    obj.cycles.use_motion_blur = False


MOTIONS = {
    "an object": lambda: moves(cube(), "location", (-0.5, 0, 0.6), (0, 0.2, 0.6), (0.5, 0, 0.6)),
    "a turn": lambda: moves(cube(), "rotation_euler", (0, 0, 0), (0, 0, 0.5), (0, 0, 1.0)),
    "a shape": bent,
    "instances": lambda: moves(scattered(), "location", (-0.3, 0, 0.2), (0, 0, 0.2), (0.3, 0, 0.2)),
    "the camera": lambda: (cube(), moves(bpy.context.scene.camera, "location", (-0.2, -5, 4), (0, -5, 4), (0.2, -5, 4))),
    "its start": lambda: moves(cube(), "location", (-0.5, 0, 0.6), (0, 0, 0.6), (0.5, 0, 0.6)),
    "not of this object": unblurred,
    "faces that change": growing,
}


def motions(asked):
    for name, make in MOTIONS.items():
        scene = empty(48)
        scene.frame_set(1)
        floor()
        world((0.6, 0.6, 0.6))
        camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
        make()
        scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.8
        scene.render.motion_blur_position = "START" if name == "its start" else "CENTER"
        both(name, asked["folder"])


def masks(asked):
    """Cryptomattes and light groups of objects, instances and a parent, and the passes that show the error, by both engines."""
    scene = empty(64, samples=64)
    floor()
    bpy.context.object.name = "le sol"
    scattered()
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(1.4, -1.2, 0.5), rotation=(0, 0, 0.4))
    box = bpy.context.object
    box.name = "Würfel.001"
    box.data.materials.append(material("red, shiny", Base_Color=(0.7, 0.1, 0.1, 1)))
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(1.4, -1.2, 1.2))
    bpy.context.object.parent = box
    bpy.context.object.matrix_parent_inverse = box.matrix_world.inverted()
    bpy.context.object.name = "on top"
    bpy.ops.mesh.primitive_plane_add(size=0.8, location=(-1.5, -1.5, 1.5), rotation=(0.5, 0.4, 0))
    glow = bpy.context.object
    glow.name, glow.lightgroup = "glow", "glows"
    glow.data.materials.append(material("glow", Emission_Color=(1, 0.6, 0.3, 1), Emission_Strength=4.0))
    layer = bpy.context.view_layer
    for name in ("key", "l'air", "glows"):
        layer.lightgroups.add(name=name)
    add("key", lamp("AREA", 100.0, size=1.0), (2, -2, 3), (0.6, 0.5, 0)).lightgroup = "key"
    add("alone", lamp("POINT", 20.0, shadow_soft_size=0.1), (-2, 1, 2))
    world((0.2, 0.25, 0.3))
    scene.world.lightgroup = "l'air"
    camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_material = layer.use_pass_cryptomatte_asset = True
    layer.pass_cryptomatte_depth = 8
    scene.primray.error_pass = scene.primray.error_overlay = scene.primray.denoise = True
    for engine in ("PRIMRAY", "CYCLES"):
        say(name=engine, file=multilayer(f"{asked['folder']}/masks.{engine}.exr", engine), notes=kept().notes)


def stops(asked):
    """Renders that end by error, by time, and by samples, with the denoised pass."""
    scene = empty(64, samples=1 << 20)
    floor()
    ball(matte())
    world((0.5, 0.5, 0.5))
    add("L", lamp("AREA", size=3.0), (1, -1, 3), (0.3, 0.3, 0))
    camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
    interface = sys.modules[f"{MODULE}.interface"]
    asked_of: dict[str, dict[str, Any]] = {
        "error": {"target_error": 0.01, "time_limit": 0.0},
        "time": {"target_error": 0.0, "time_limit": 1.0},
        "samples": {"time_limit": 0.0, "samples": 4, "denoise": True},
        "many samples": {"samples": 512},
    }
    for name, values in asked_of.items():
        for setting, value in values.items():
            setattr(scene.primray, setting, value)
        file = multilayer(f"{asked['folder']}/{name}.exr", "PRIMRAY")
        say(name=name, file=file, words=interface.end_in_words(), **interface.END)


def first_hour(asked):
    """A scene with a Principled material, an image of a sky, hair, smoke and an instancer, with passes."""
    scene = empty(64, samples=32)
    floor()
    linked_world((0, 0, 1.0), 1.5)
    scattered()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0, 0, 1.2))
    furry = bpy.context.object
    furry.data.materials.append(material("fur", Base_Color=(0.5, 0.3, 0.1, 1)))
    furry.modifiers.new("hair", "PARTICLE_SYSTEM")
    settings = furry.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.root_radius = "HAIR", 200, 0.3, 0.02
    smoke(asked, volume(PRINCIPLED_VOLUME, Density=3.0, Anisotropy=0.2), (-1.6, 0, 1.1), scale=(0.7, 0.7, 0.7))
    camera((0, -5, 3), (math.radians(62), 0, 0), lens=35.0)
    both("first hour", asked["folder"])
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_normal = True
    scene.primray.error_pass = True
    say(name="passes", file=multilayer(f"{asked['folder']}/passes.exr", "PRIMRAY"))
    bpy.ops.primray.save_stage(directory=f"{asked['folder']}/saved")


def showcase(asked):
    """The picture of docs/blender.md."""
    scene = empty(360, samples=asked.get("samples", 64))
    scene.render.resolution_y = 270
    bpy.ops.mesh.primitive_plane_add(size=30)
    bpy.context.object.data.materials.append(material("ground", Base_Color=(0.35, 0.33, 0.3, 1), Roughness=0.6))
    linked_world((0, 0, 2.0), 0.5)
    looks = (
        material("gold", Base_Color=(0.9, 0.6, 0.25, 1), Metallic=1.0, Roughness=0.25),
        material("glass", Transmission_Weight=1.0, Roughness=0.0, Base_Color=(0.75, 0.9, 0.85, 1)),
        material("lacquer", Base_Color=(0.5, 0.03, 0.04, 1), Coat_Weight=1.0, Coat_Roughness=0.05, Roughness=0.5),
    )
    for k, look in enumerate(looks):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=0.55, location=(1.25 * k - 1.7, 0, 0.55))
        bpy.ops.object.shade_smooth()
        bpy.context.object.data.materials.append(look)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.4, location=(2.0, 0.1, 0.5))
    furry = bpy.context.object
    furry.data.materials.append(material("fur", Base_Color=(0.55, 0.35, 0.15, 1), Roughness=0.5))
    furry.modifiers.new("hair", "PARTICLE_SYSTEM")
    settings = furry.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.root_radius = "HAIR", 4000, 0.15, 0.4
    grid = scattered()
    grid.scale, grid.location = (1.6, 0.5, 1.0), (0.2, 2.4, 0.3)
    add("L", lamp("AREA", 250.0, size=1.5, spread=math.radians(120)), (-2.5, -2.5, 4), (math.radians(40), 0, math.radians(-45)))
    add("S", lamp("SPOT", 400.0, spot_size=0.7, spot_blend=0.4, color=(1, 0.75, 0.5)), (3, -2, 4), (0.5, 0.55, 0.4))
    camera((0.2, -6.5, 2.3), (math.radians(76), 0, 0.0), lens=48.0)
    both("showcase", asked["folder"])


def keyed(owner, path, values, index=-1):
    for frame, value in enumerate(values, 1):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, index=index, frame=frame)


def moving():
    """A scene in which between frames something moves, deforms, appears and has another look, and the most stays."""
    scene = empty(48, samples=4)
    floor()
    for k in range(6):
        bpy.ops.mesh.primitive_cube_add(size=0.4, location=(k / 2 - 1.3, 1.2, 0.2))
        bpy.context.object.data.materials.append(material(f"look {k}", Base_Color=(k / 6, 0.4, 0.5, 1)))
        bpy.context.object.name = f"still {k}"
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(-1, 0, 0.4), rotation=(0.1, 0.2, 0.3), scale=(1, 1.3, 0.8))
    parent = bpy.context.object
    parent.name = "moves, above"
    parent.data.materials.append(material("changes"))
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(0.1, 0.2, 0.6))
    bpy.context.object.parent, bpy.context.object.name = parent, "moves, below"
    keyed(parent, "location", (-1.0, -0.6, -0.2), 0)
    socket = bpy.data.materials["changes"].node_tree.nodes["Principled BSDF"].inputs["Roughness"]
    for frame, value in enumerate((0.2, 0.5, 0.5), 1):
        socket.default_value = value
        socket.keyframe_insert("default_value", frame=frame)
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(0.9, -0.2, 0.4))
    body = bpy.context.object
    body.name = "deforms"
    body.shape_key_add(name="basis")
    key = body.shape_key_add(name="other")
    for point in key.data:
        point.co.z *= 1.5
    keyed(key, "value", (0.0, 0.0, 1.0))
    body.modifiers.new("smooth", "SUBSURF")
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(0, -1, 0.2))
    bpy.context.object.name = "appears"
    keyed(bpy.context.object, "hide_render", (True, True, False))
    collections()
    world((0.6, 0.6, 0.6))
    camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
    return scene


def animation(asked):
    """The frames of a scene, each exported after the ones before it and by itself."""
    scene = moving()
    for kind in ("after others", "alone"):
        for frame in (1, 2, 3, 3):
            if kind == "alone" and kept().exporter is not None:
                kept().exporter.end()
            scene.frame_set(frame)
            file = render("PRIMRAY", f"{asked['folder']}/{kind}.{frame}.exr")
            say(name=kind, frame=frame, file=file, exported=kept().exported, notes=kept().notes)


class Watched:
    """A preview with the time of each picture, told of changes as Blender tells a viewport's engine."""

    def __init__(self, folder):
        self.engine = sys.modules[f"{MODULE}.engine"]
        self.folder, self.wanted, self.saved = folder, threading.Event(), 0
        self.preview = self.engine.preview_of(lambda is_wanted: self.wanted.set() if is_wanted else None)
        bpy.app.handlers.depsgraph_update_post.append(self.update)
        self.camera, self.rotation = None, 0.0

    def open(self, rotation=0.0):
        self.update(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
        self.look(rotation)

    def update(self, scene, depsgraph):
        self.engine.show_changes(self.preview, depsgraph)

    def look(self, rotation=0.0, **settings):
        """Look by the scene's camera, turned around the vertical axis."""
        scene, obj = bpy.context.scene, bpy.context.scene.camera
        self.rotation = rotation
        depsgraph = bpy.context.evaluated_depsgraph_get()
        size = (scene.render.resolution_x, scene.render.resolution_y)
        placed = Matrix.Rotation(rotation, 4, "Z") @ obj.matrix_world
        projection = obj.calc_matrix_camera(depsgraph, x=size[0], y=size[1])
        viewport = sys.modules[f"{MODULE}.viewport"]
        self.camera = viewport.camera_of(placed.inverted(), projection, distance=obj.location.length)
        self.preview.look(self.camera, size, self.engine.view_settings(scene) | settings)

    def wait(self, done, seconds=120.0):
        """Wait until `done`, as Blender's window would redraw and ask for updates meanwhile."""
        start = time.monotonic()
        while not done():
            if self.wanted.is_set():
                self.wanted.clear()
                self.update(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
            assert time.monotonic() < start + seconds, self.preview.error
            time.sleep(0.002)
        return time.monotonic() - start

    def is_shown(self, finished=True):
        shown = self.preview.picture
        return shown is not None and shown.edition == self.preview.edition and (shown.is_finished or not finished)

    def step(self, name, change=lambda: None, **more):
        """Make a change, and say when it was first seen and when the picture was finished."""
        before = self.preview.edition
        change()
        bpy.context.view_layer.update()
        first = self.wait(lambda: self.preview.edition > before and self.is_shown(False))
        whole = first + self.wait(self.is_shown)
        say(
            name=name, first=first, whole=whole, file=self.save(), exported=self.preview.exported, exports=self.preview.exports,
            camera=self.camera, **more,
        )  # fmt: skip

    def save(self):
        self.saved += 1
        file = f"{self.folder}/view-{id(self)}-{self.saved}.npy"
        np.save(file, self.preview.picture.pixels)
        return file

    def end(self):
        bpy.app.handlers.depsgraph_update_post.remove(self.update)
        self.preview.end()


def viewport(asked):
    """A viewport's pictures after changes of all kinds, and those of a viewport that is opened then."""
    scene = moving()
    scene.primray.preview_samples = 8
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    obj = bpy.data.objects
    obj["moves, above"].animation_data_clear()  # what is animated is where its keys say whenever a frame is set
    light = add("lamp", lamp("AREA", 100.0, size=1.0), (1, -2, 3), (0.6, 0.2, 0))
    look = bpy.data.materials["look 2"].node_tree.nodes["Principled BSDF"].inputs
    view = Watched(asked["folder"])

    def deform():
        obj["still 1"].data.vertices[0].co.z += 0.3
        obj["still 1"].data.update()

    view.step("opened", view.open)
    changes = (
        ("moved", lambda: setattr(obj["moves, above"], "location", (0.4, -0.3, 0.8))),
        ("turned", lambda: setattr(obj["moves, below"], "rotation_euler", (0.4, -0.3, 0.8))),
        ("lamp moved", lambda: setattr(light, "location", (-1, -2, 3))),
        ("looked from elsewhere", lambda: view.look(0.3)),
        ("material", lambda: setattr(look["Base Color"], "default_value", (0.9, 0.1, 0.1, 1))),
        ("mesh", deform),
        ("lamp", lambda: setattr(light.data, "energy", 300.0)),
        ("world", lambda: world((0.1, 0.2, 0.4))),
        ("gone", lambda: bpy.data.objects.remove(obj["still 3"])),
        ("come", lambda: bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0, 0.5, 0.9))),
        ("moved again", lambda: setattr(obj["moves, above"], "location", (0.2, -0.1, 0.6))),
    )
    for name, change in changes:
        view.step(name, change)
        if name in ("moved", "mesh", "moved again"):
            other = Watched(asked["folder"])
            other.step(f"{name}, opened then", lambda other=other: other.open(view.rotation))
            shutil.copytree(Path(other.preview.stage).parent, f"{asked['folder']}/stage, {name}")
            other.end()
    view.end()


def viewport_trouble(asked):
    """A viewport whose render is cancelled, and whose processes end."""
    scene = empty(48)
    scene.primray.preview_samples = 8
    floor()
    bpy.ops.mesh.primitive_cube_add(size=0.6)
    cube = bpy.context.object
    cube.data.materials.append(matte())
    world((0.6, 0.6, 0.6))
    camera((0, -5, 4), (math.radians(52), 0, 0), lens=35.0)
    view = Watched(asked["folder"])
    processes = view.preview._processes

    def move(height):
        return lambda: setattr(cube, "location", (0, 0, height))

    def deform():
        cube.data.vertices[0].co.z += 0.3
        cube.data.update()

    view.step("opened", view.open)
    scene.camera = None
    view.step("no camera", deform, error=view.preview.error)
    scene.camera = bpy.data.objects["Camera"]
    bpy.context.view_layer.update()
    view.look(0.1, samples=1 << 20)
    view.wait(lambda: view.is_shown(False) and view.preview.picture.samples > 8)
    view.preview.cancel()
    time.sleep(1)
    before = view.preview.picture
    time.sleep(2)
    say(name="cancelled", is_still=view.preview.picture is before, samples=before.samples, is_finished=before.is_finished)
    view.step("after it", lambda: view.look(0.2))
    for which, change in (("renderer", move(0.5)), ("exporter", deform)):
        processes[which]._process.kill()
        view.wait(lambda: view.preview.error)
        told = view.preview.error
        view.step(f"the {which} has ended", change, told=told, error=view.preview.error)
    view.step("moved", move(0.8))
    say(name="end", error=view.preview.error)
    view.end()


def viewport_cameras(asked):
    """What a viewport shows by the matrices of the scene's camera, beside a render by that camera."""
    for name in ("perspective", "shifted", "portrait", "orthographic"):
        scene = empty(48, samples=16)
        scene.render.resolution_y = 32
        scene.primray.preview_samples = 16
        bpy.ops.mesh.primitive_cube_add(size=1, location=(0.5, 0.2, 0.3), rotation=(0.3, 0.2, 0.4))
        bpy.context.object.data.materials.append(matte())
        world((0.5, 0.5, 0.5))
        add("L", lamp("SUN", 2.0), (0, 0, 2), (0.6, 0.2, 0))
        camera((0, -4, 1), (math.radians(75), 0, 0.1), **CAMERAS[name])
        file = render("PRIMRAY", f"{asked['folder']}/{name}.exr")
        view = Watched(asked["folder"])
        view.step(name, view.open, render=file)
        view.end()


def failures(asked):
    """What goes wrong is an error of the operator, and Blender goes on."""
    scene = empty()
    floor()

    def attempt(name):
        try:
            bpy.ops.render.render()
            say(name=name, error="")
        except RuntimeError as error:
            say(name=name, error=str(error))

    scene.render.engine = "PRIMRAY"
    attempt("no camera")
    camera()
    preferences = bpy.context.preferences.addons[MODULE].preferences
    preferences.python = "/nowhere/python"
    attempt("no Python")
    preferences.python = asked["python"]
    times_asked = iter(range(1000))
    kept().is_cancelled = lambda: next(times_asked) > 2
    attempt("cancelled")
    kept().is_cancelled = lambda: False
    kept().exporter.end()
    attempt("the exporter has ended")
    attempt("after all")


if __name__ == "__main__":
    job, request = sys.argv[1], json.loads(sys.argv[2])
    install(request)
    globals()[job](request)
    kept().end()
