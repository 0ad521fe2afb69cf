"""Translation of a USD stage to a SceneDescription: the only package that imports pxr, and it renders nothing.

`stage` opens and reads the stage; `scene` visits it once per distinct prototype, carries what prims inherit, and collects
groups of leaf prims and instances; `instancing` computes where groups are placed, as products of levels; adapters turn one
resolved prim into description objects; `translate` holds the table of adapters and runs the passes in order: stage edits, view,
traversal, description. `inspect` has facts about a stage, `incremental` translates again after edits. All matrices are double
precision and column-vector.
"""

from .camera.camera import nearest_of
from .camera.framed_objects import framed_bounds
from .camera.lidar import LidarPrim, lidar_poses, lidar_prim, lidar_prims, lidar_units
from .camera.session_camera import camera_layer, has_camera, is_session_camera, place_camera
from .inspect.authored_meters import AuthoredMeter, authored_meters
from .inspect.dependencies import Dependencies, check_layer_output, dependencies, files_to_watch, layer_files, write_usdz
from .inspect.labelled import LabelledPrim, LabelledPrims
from .inspect.layer_edits import Edit, edits_between, files_named, made_alone, sampled_times, used_layer
from .inspect.light_path_layer import LIGHT_PATHS, light_path_layer
from .inspect.prim_identity import assets_of, names_in_instances
from .inspect.scene_facts import stage_facts
from .inspect.undrawn_shapes import count_undrawn_shapes, undrawn_lights, undrawn_shapes
from .lights.weight_layer import weight_layer
from .materials.bound_materials import bound_materials
from .render_settings.outputs import can_share_render, ordered_picture_channels, output_facts, outputs_of, pixel_settings
from .render_settings.render_product import ProductSettings, RenderVariable
from .render_settings.render_settings import named_product, products
from .scene.bounds import world_box
from .stage.asset_previews import check_preview, write_with_preview
from .stage.layer_copy import readable_layer
from .stage.metadata import stage_name, used_files
from .stage.open import limit_threads, open_stage, reload_layers, scratch_copy
from .stage.reads import read_asset
from .translate import camera_paths, translate
from .variation.larger_light import can_be_larger, larger_light
from .variation.rougher_material import can_be_rougher, rougher_material
from .variation.varied_stage import VariedStage

__all__ = [
    "LIGHT_PATHS",
    "AuthoredMeter",
    "Dependencies",
    "Edit",
    "LabelledPrim",
    "LabelledPrims",
    "LidarPrim",
    "ProductSettings",
    "RenderVariable",
    "VariedStage",
    "assets_of",
    "authored_meters",
    "bound_materials",
    "camera_layer",
    "camera_paths",
    "can_be_larger",
    "can_be_rougher",
    "can_share_render",
    "check_layer_output",
    "check_preview",
    "count_undrawn_shapes",
    "dependencies",
    "edits_between",
    "files_named",
    "files_to_watch",
    "framed_bounds",
    "has_camera",
    "is_session_camera",
    "larger_light",
    "layer_files",
    "lidar_poses",
    "lidar_prim",
    "lidar_prims",
    "lidar_units",
    "light_path_layer",
    "limit_threads",
    "made_alone",
    "named_product",
    "names_in_instances",
    "nearest_of",
    "open_stage",
    "ordered_picture_channels",
    "output_facts",
    "outputs_of",
    "pixel_settings",
    "place_camera",
    "products",
    "read_asset",
    "readable_layer",
    "reload_layers",
    "rougher_material",
    "sampled_times",
    "scratch_copy",
    "stage_facts",
    "stage_name",
    "translate",
    "undrawn_lights",
    "undrawn_shapes",
    "used_files",
    "used_layer",
    "weight_layer",
    "world_box",
    "write_usdz",
    "write_with_preview",
]
