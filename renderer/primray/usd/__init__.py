"""Translation of a USD stage to a SceneDescription: the only package that imports pxr, and it renders nothing.

`stage` opens the stage; `walk` visits it once per distinct prototype, carries what prims inherit (`resolve`), and collects
groups of leaf prims and instances; `instances` computes where groups are placed, as products of levels; `adapters` turn one
resolved prim into description objects; `translate` holds the table of adapters and runs all of this in order. All matrices are
double precision and column-vector.
"""

from .adapters.rendering.product_outputs import can_be_made_together, outputs_of, picture_of_product, picture_ordered
from .adapters.rendering.render_product import ProductSettings, RenderVariable
from .adapters.rendering.render_settings import named_product, products
from .facts.assets import assets_of
from .facts.bound import bound_materials
from .facts.dependencies import Dependencies, dependencies, files_to_watch, layer_files, write_usdz
from .facts.labels import labels_of
from .facts.left_out import left_out, shapes_left_out
from .facts.names_in_instances import names_in_instances
from .facts.output_facts import output_facts
from .facts.stage_facts import stage_facts
from .opening.reading_anew import read_anew
from .opening.stage import open_stage
from .opening.stage_metadata import stage_name, used_files
from .querying.asset import read_asset
from .translate import camera_paths, translate
from .viewing.drawn import drawn_bounds
from .viewing.session_camera import has_camera, is_session_camera, place_camera

__all__ = [
    "Dependencies",
    "ProductSettings",
    "RenderVariable",
    "assets_of",
    "bound_materials",
    "camera_paths",
    "can_be_made_together",
    "dependencies",
    "drawn_bounds",
    "files_to_watch",
    "has_camera",
    "is_session_camera",
    "labels_of",
    "layer_files",
    "left_out",
    "named_product",
    "names_in_instances",
    "open_stage",
    "output_facts",
    "outputs_of",
    "picture_of_product",
    "picture_ordered",
    "place_camera",
    "products",
    "read_anew",
    "read_asset",
    "shapes_left_out",
    "stage_facts",
    "stage_name",
    "translate",
    "used_files",
    "write_usdz",
]
