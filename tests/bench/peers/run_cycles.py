"""Cycles, as Blender's Python module, on a compared scene (loop.py has the job). Meshes and instances come from the USD
file, looks and lights are made here so that they mean what scenes.py says."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from .cycles_motion import animate
from .installed import DENOISED
from .loop import Render, Save, Stages, run
from .plain import EMITTING, PlainScene
from .shapes import cylinder, disc, rectangle

LIGHT_BOUNCES = 1024


def setup(scene: PlainScene, job: dict[str, Any]) -> tuple[Render, Save, Stages]:
    began = time.perf_counter()
    import bpy
    from mathutils import Matrix

    imported = time.perf_counter()
    moves = bool(scene.facts.get("motion"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.context.scene
    bpy.ops.wm.usd_import(
        filepath=scene.file(f"{scene.name}{'_still' if moves else ''}.usdc"),
        import_cameras=False,
        import_lights=False,
        import_curves=False,
        create_world_material=False,
    )
    opened = time.perf_counter()
    z_up = Matrix.Rotation(math.pi / 2, 4, "X")
    looks = {name: _look(bpy, name, look) for name, look in scene["looks"].items()}
    wanted = [*scene["objects"], *([tuple(scene["placed"].values())] if scene["placed"] else [])]
    for mesh, look in wanted:
        thing = bpy.data.objects[mesh]
        thing.data.materials.clear()
        thing.data.materials.append(looks[look])
        thing.cycles.shadow_terminator_offset = thing.cycles.shadow_terminator_geometry_offset = 0
        if mesh not in scene["smooth"]:
            thing.data.shade_flat()
    if scene.facts.get("strands"):
        _strands(bpy, scene, world, z_up, looks[scene["strands"]["look"]])
    _lights(bpy, Matrix, scene, world, z_up)
    _camera(bpy, Matrix, scene, world, z_up)
    _settings(scene, job, world)
    if moves:
        animate(bpy, scene, world, z_up)
    stages = {"import": imported - began, "open": opened - imported, "make": time.perf_counter() - opened}

    def render(samples: int, seed: int) -> None:
        world.cycles.samples = samples
        world.cycles.seed = seed
        world.update_tag()
        bpy.ops.render.render()

    return render, lambda path: bpy.data.images["Render Result"].save_render(path), stages


def _nodes(owner: Any) -> Any:
    owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def _node(tree: Any, kind: str, **values: Any) -> Any:
    return _fill(tree.nodes.new(kind), **values)


def _fill(node: Any, **values: Any) -> Any:
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node


def _look(bpy: Any, name: str, look: dict[str, Any]) -> Any:
    material = bpy.data.materials.new(f"look_{name}")
    tree = _nodes(material)
    color = (*look["color"], 1.0)
    if look["kind"] == "glass":
        bsdf = _node(tree, "ShaderNodeBsdfGlass", Color=(1.0, 1.0, 1.0, 1.0), Roughness=0.0, IOR=look["ior"])
    elif look["kind"] == "metal":
        bsdf = _node(tree, "ShaderNodeBsdfMetallic", Roughness=look["roughness"], Base_Color=color, Edge_Tint=(1, 1, 1, 1))
        bsdf.distribution, bsdf.fresnel_type = "GGX", "F82"  # with a white edge: Schlick's
    elif look["kind"] == "plastic":
        bsdf = _node(tree, "ShaderNodeBsdfPrincipled", Base_Color=color, Roughness=look["roughness"], IOR=look["ior"])
    elif look["kind"] == "hair":
        bsdf = _node(tree, "ShaderNodeBsdfHairPrincipled")
        bsdf.model, bsdf.parametrization = "CHIANG", "ABSORPTION"  # before: inputs of others have no names here
        _fill(
            bsdf, Absorption_Coefficient=look["color"], Roughness=look["roughness"], Radial_Roughness=look["roughness"],
            IOR=look["ior"], Offset=0.0, Coat=0.0,
        )  # fmt: skip
    elif look["kind"] == "layered":
        bsdf = _node(
            tree, "ShaderNodeBsdfPrincipled", Base_Color=color, Roughness=look["roughness"], IOR=look["ior"],
            Metallic=look["metalness"], Transmission_Weight=look["transmission"], Coat_Weight=look["coat"], Coat_Roughness=0.1,
            Coat_IOR=1.5, Sheen_Weight=look["fuzz"], Subsurface_Weight=look["subsurface"], Subsurface_Scale=1.0,
            Subsurface_Radius=look["radius"],
        )  # fmt: skip
        bsdf.subsurface_method = "RANDOM_WALK"
    elif look["kind"] in EMITTING:
        bsdf = _node(tree, "ShaderNodeEmission", Color=color, Strength=1.0)
    else:
        bsdf = _node(tree, "ShaderNodeBsdfDiffuse", Roughness=0.0, Color=color)
    output = _node(tree, "ShaderNodeOutputMaterial")
    tree.links.new(bsdf.outputs[0], output.inputs["Surface"])
    return material


def _strands(bpy: Any, scene: PlainScene, world: Any, z_up: Any, look: Any) -> None:
    """Its strands go through their points: through those of the B-splines at their knots, and half way between."""
    b = scene.strands()
    knots = (b[:, :-2] + 4 * b[:, 1:-1] + b[:, 2:]) / 6
    middles = (b[:, :-3] + 23 * b[:, 1:-2] + 23 * b[:, 2:-1] + b[:, 3:]) / 48
    points = np.empty((len(b), 2 * knots.shape[1] - 1, 3))
    points[:, ::2], points[:, 1::2] = knots, middles
    made = bpy.data.hair_curves.new("strands")
    made.add_curves([points.shape[1]] * len(points))
    made.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
    radius = made.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(points.shape[0] * points.shape[1], scene["strands"]["radius"], np.float32))
    made.materials.append(look)
    thing = bpy.data.objects.new("strands", made)
    thing.matrix_world = z_up
    world.collection.objects.link(thing)
    world.cycles_curves.shape = "THICK"


def _lights(bpy: Any, Matrix: Any, scene: PlainScene, world: Any, z_up: Any) -> None:
    seen = []
    for lamp in scene["lamps"]:
        matrix = np.eye(4)
        if lamp["kind"] == "sky":
            _sky(bpy, scene, world, lamp)
            continue
        if lamp["kind"] == "tube":
            _tube(bpy, world, z_up, lamp)
            continue
        if lamp["kind"] == "sun":
            matrix[:3, :3] = _frame(np.array(lamp["direction"]))
            light = _light(bpy, "SUN", lamp["radiance"])
            light.angle = 0.0
        elif lamp["kind"] == "ball":
            matrix[:3, 3] = lamp["center"]
            power = [c * 4 * math.pi**2 * lamp["radius"] ** 2 for c in lamp["radiance"]]  # pi times its area
            light = _light(bpy, "POINT", power)
            light.shadow_soft_size = lamp["radius"]
            light.use_soft_falloff = False
            seen.append((*_ball(lamp["center"], lamp["radius"]), lamp["radiance"]))
        else:
            u, v = np.array(lamp["half_u"], float), np.array(lamp["half_v"], float)
            width, height = np.linalg.norm(u), np.linalg.norm(v)
            matrix[:3] = np.stack([u / width, -v / height, -np.cross(u / width, v / height), lamp["center"]], axis=1)
            round_one = lamp["kind"] == "disc"
            area = (math.pi if round_one else 4) * width * height
            light = _light(bpy, "AREA", [c * math.pi * area for c in lamp["radiance"]])
            light.shape, light.size, light.size_y = "ELLIPSE" if round_one else "RECTANGLE", 2 * width, 2 * height
            shape = (disc if round_one else rectangle)(lamp["center"], lamp["half_u"], lamp["half_v"])
            seen.append((shape.points, shape.faces, lamp["radiance"]))
        placed = bpy.data.objects.new("light", light)
        placed.matrix_world = z_up @ Matrix(matrix.tolist())
        world.collection.objects.link(placed)
    if seen:
        _seen_lamps(bpy, world, z_up, seen)
    if world.world is None:
        world.world = bpy.data.worlds.new("dark")
        _node(_nodes(world.world), "ShaderNodeOutputWorld")


def _tube(bpy: Any, world: Any, z_up: Any, lamp: dict[str, Any]) -> None:
    """It has no lamp of that shape: a mesh."""
    shape = cylinder(lamp["center"], lamp["half_u"], lamp["radius"])
    mesh = bpy.data.meshes.new("tube")
    mesh.from_pydata(shape.points.tolist(), [], shape.faces.tolist())
    mesh.materials.append(_look(bpy, "tube", {"kind": EMITTING[0], "color": lamp["radiance"]}))
    placed = bpy.data.objects.new("tube", mesh)
    placed.matrix_world = z_up
    world.collection.objects.link(placed)


def _light(bpy: Any, kind: str, power: list[float]) -> Any:
    light = bpy.data.lights.new("light", kind)
    light.energy = max(power)
    light.color = [p / max(power) for p in power]
    light.cycles.max_bounces = LIGHT_BOUNCES
    return light


def _seen_lamps(bpy: Any, world: Any, z_up: Any, seen: list[Any]) -> None:
    """Cycles' lamps are not seen by the camera: meshes that only it sees stand where they are."""
    starts = np.cumsum([0, *(len(points) for points, _, _ in seen)])
    points = np.concatenate([points for points, _, _ in seen])
    faces = np.concatenate([triangles + start for (_, triangles, _), start in zip(seen, starts, strict=False)])
    radiance = np.concatenate([np.tile(color, (len(triangles), 1)) for _, triangles, color in seen])
    mesh = bpy.data.meshes.new("lamps")
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    mesh.attributes.new("radiance", "FLOAT_VECTOR", "FACE").data.foreach_set("vector", radiance.astype(np.float32).ravel())
    material = bpy.data.materials.new("lamps")
    material.cycles.emission_sampling = "NONE"
    tree = _nodes(material)
    attribute = _node(tree, "ShaderNodeAttribute")
    attribute.attribute_name = "radiance"
    emission = _node(tree, "ShaderNodeEmission", Strength=1.0)
    tree.links.new(attribute.outputs["Vector"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], _node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    mesh.materials.append(material)
    placed = bpy.data.objects.new("lamps", mesh)
    placed.matrix_world = z_up
    world.collection.objects.link(placed)
    for rays in ("diffuse", "glossy", "transmission", "shadow", "volume_scatter"):
        setattr(placed, f"visible_{rays}", False)


def _sky(bpy: Any, scene: PlainScene, world: Any, lamp: dict[str, Any]) -> None:
    world.world = bpy.data.worlds.new("sky")
    tree = _nodes(world.world)
    image = bpy.data.images.load(scene.file(lamp["image"]))
    image.colorspace_settings.name = "Linear Rec.709"
    where = _node(tree, "ShaderNodeTexCoord")
    turn = _node(tree, "ShaderNodeMapping", Rotation=(0.0, 0.0, math.pi / 2))
    texture = _node(tree, "ShaderNodeTexEnvironment")
    texture.image = image
    background = _node(tree, "ShaderNodeBackground")
    tree.links.new(where.outputs["Generated"], turn.inputs[0])
    tree.links.new(turn.outputs[0], texture.inputs[0])
    tree.links.new(texture.outputs[0], background.inputs[0])
    tree.links.new(background.outputs[0], _node(tree, "ShaderNodeOutputWorld").inputs["Surface"])


def _frame(direction: Any) -> Any:
    """Columns: right, up, and back, against the direction of the light."""
    back = -direction / np.linalg.norm(direction)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)


def _ball(center: Any, radius: float, rings: int = 12) -> Any:
    """A sphere of quads around y, split."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.arange(2 * rings) * np.pi / rings, indexing="ij")
    unit = np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1).reshape(-1, 3)
    i, j = np.mgrid[0:rings, 0 : 2 * rings]
    a, b = i * 2 * rings + j, i * 2 * rings + (j + 1) % (2 * rings)
    faces = np.stack([a, a + 2 * rings, b + 2 * rings, a, b + 2 * rings, b], axis=-1).reshape(-1, 3)
    return unit * radius + np.asarray(center), faces


def _camera(bpy: Any, Matrix: Any, scene: PlainScene, world: Any, z_up: Any) -> None:
    facts = scene["camera"]
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "HORIZONTAL"
    camera.angle = math.radians(facts["fov_deg"])
    camera.clip_start, camera.clip_end = 0.01, 1e5
    eye = np.array(facts["eye"], float)
    matrix = np.eye(4)
    matrix[:3, :3] = _frame(np.array(facts["target"]) - eye)
    matrix[:3, 3] = eye
    placed = bpy.data.objects.new("camera", camera)
    placed.matrix_world = z_up @ Matrix(matrix.tolist())
    world.collection.objects.link(placed)
    world.camera = placed


def _settings(scene: PlainScene, job: dict[str, Any], world: Any) -> None:
    render, cycles = world.render, world.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = scene["resolution"]
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", job["threads"]
    render.use_persistent_data = True  # the scene stays between pictures, as in the other renderers
    render.use_compositing = render.use_sequencer = False
    render.dither_intensity = 0
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_fast_gi = False
    if job["variant"] == DENOISED:
        # Open Image Denoise by albedo and normals, as it stands there by default.
        cycles.use_denoising, cycles.denoiser, cycles.denoising_use_gpu = True, "OPENIMAGEDENOISE", False
    cycles.pixel_filter_type = "BOX"
    cycles.film_exposure = 1
    bounces = scene["depth"] - 1  # it counts what comes after the first surface
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = bounces
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.use_light_tree = True
    world.view_settings.view_transform, world.view_settings.look = "Raw", "None"
    picture = render.image_settings
    picture.file_format, picture.color_mode, picture.color_depth, picture.exr_codec = "OPEN_EXR", "RGB", "32", "ZIP"


if __name__ == "__main__":
    run(setup)
