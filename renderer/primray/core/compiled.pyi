"""Types of the compiled core; generated from it by `make stubs`."""

import enum
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Annotated, Any, overload

import numpy
from numpy.typing import NDArray

testing: ModuleType

ISA: str

MAX_LANES: int

def load_embree(path: str) -> None:
    """Load the Embree library at this path; later calls do nothing."""

def embree_memory() -> tuple[int, int]:
    """Return the current and peak memory of Embree in bytes."""

def limit_embree_memory(bytes: int) -> None:
    """Limit the memory of Embree; builds that would exceed it fail."""

def watch_memory(
    bytes: int, before: str = "", after: str = "", json_before: str = "", json_after: str = "", exit_code: int = 4
) -> None:
    """
    End the process with a message before it holds more than `bytes`; 0: stop watching.
    """

def record_spans(on: bool) -> None:
    """Start or stop recording time spans of the core's work."""

def take_spans() -> list[tuple[str, int, int, int]]:
    """
    Return the recorded spans, each its name, thread, and begin and end in nanoseconds of time.monotonic_ns(), and forget them.
    """

class CoreError(Exception):
    pass

TILE: int = 16

FILM_PIXEL_BYTES: int = 126

class Attribute(enum.Enum):
    NONE = 0

    TRIANGLE = 1

    VERTEX = 2

    CORNER = 3

class PrimvarKind(enum.Enum):
    CONSTANT = 0

    FACE = 1

    POINT = 2

    CORNER = 3

    INSTANCE = 4

class Wrap(enum.Enum):
    BLACK = 0

    CLAMP = 1

    REPEAT = 2

    MIRROR = 3

class InputField(enum.Enum):
    diffuse_color = 0

    emissive_color = 1

    specular_color = 2

    metallic = 3

    roughness = 4

    clearcoat = 5

    clearcoat_roughness = 6

    opacity = 7

    ior = 8

    normal = 9

    open_pbr_base_weight = 10

    open_pbr_base_color = 11

    open_pbr_base_diffuse_roughness = 12

    open_pbr_base_metalness = 13

    open_pbr_specular_weight = 14

    open_pbr_specular_color = 15

    open_pbr_specular_roughness = 16

    open_pbr_specular_roughness_anisotropy = 17

    open_pbr_specular_ior = 18

    open_pbr_transmission_weight = 19

    open_pbr_transmission_color = 20

    open_pbr_transmission_depth = 21

    open_pbr_transmission_scatter = 22

    open_pbr_transmission_scatter_anisotropy = 23

    open_pbr_transmission_dispersion_scale = 24

    open_pbr_transmission_dispersion_abbe_number = 25

    open_pbr_subsurface_weight = 26

    open_pbr_subsurface_color = 27

    open_pbr_subsurface_radius = 28

    open_pbr_subsurface_radius_scale = 29

    open_pbr_subsurface_scatter_anisotropy = 30

    open_pbr_fuzz_weight = 31

    open_pbr_fuzz_color = 32

    open_pbr_fuzz_roughness = 33

    open_pbr_coat_weight = 34

    open_pbr_coat_color = 35

    open_pbr_coat_roughness = 36

    open_pbr_coat_roughness_anisotropy = 37

    open_pbr_coat_ior = 38

    open_pbr_coat_darkening = 39

    open_pbr_coat_roughening = 40

    open_pbr_thin_film_weight = 41

    open_pbr_thin_film_thickness = 42

    open_pbr_thin_film_ior = 43

    tangent = 44

    hair_absorption = 74

    hair_tint_r = 75

    hair_tint_tt = 76

    hair_tint_trt = 77

    hair_variance_r = 78

    hair_variance_tt = 79

    hair_variance_trt = 80

    hair_scale_r = 81

    hair_scale_tt = 82

    hair_scale_trt = 83

    hair_ior = 84

    hair_cuticle_tilt = 85

class LightType(enum.Enum):
    SPHERE = 1

    DISK = 2

    RECT = 3

    CYLINDER = 4

    DISTANT = 5

    POINT = 0

    LINE = 8

    DOME = 6

    GEOMETRY = 7

    VOLUME = 9

class DomeFormat(enum.Enum):
    LAT_LONG = 0

    MIRRORED_BALL = 1

    ANGULAR = 2

    VERTICAL_CROSS = 3

LPE_EVENTS: int = 8

LPE_ENDS: int = 3

class LpeAutomaton:
    def __init__(
        self,
        next: NDArray[numpy.uint8],
        class_of: NDArray[numpy.uint8],
        members: NDArray[numpy.uint32],
        expressions: int,
        counts_straight: bool,
        leaves_out: int = -1,
    ) -> None: ...
    @property
    def expressions(self) -> int: ...

class Cancellation:
    def __init__(self) -> None: ...
    def ask(self) -> None: ...
    def clear(self) -> None: ...
    @property
    def is_asked(self) -> bool: ...

class IntegratorSettings:
    def __init__(self) -> None: ...
    @property
    def max_depth(self) -> int: ...
    @max_depth.setter
    def max_depth(self, arg: int, /) -> None: ...
    @property
    def threads(self) -> int: ...
    @threads.setter
    def threads(self, arg: int, /) -> None: ...
    @property
    def seed(self) -> int: ...
    @seed.setter
    def seed(self, arg: int, /) -> None: ...
    @property
    def splits(self) -> int: ...
    @splits.setter
    def splits(self, arg: int, /) -> None: ...
    @property
    def clamp_indirect(self) -> float: ...
    @clamp_indirect.setter
    def clamp_indirect(self, arg: float, /) -> None: ...
    @property
    def screen_block(self) -> int: ...
    @screen_block.setter
    def screen_block(self, arg: int, /) -> None: ...
    @property
    def light_samples(self) -> int: ...
    @light_samples.setter
    def light_samples(self, arg: int, /) -> None: ...

    guide: Guide | None

    caustics: CausticGuide | None

    cancel: Cancellation | None

    lpe: LpeAutomaton | None

class FogInput:
    def __init__(self) -> None: ...
    @property
    def density(self) -> float: ...
    @density.setter
    def density(self, arg: float, /) -> None: ...
    @property
    def phase(self) -> float: ...
    @phase.setter
    def phase(self, arg: float, /) -> None: ...
    @property
    def falloff(self) -> float: ...
    @falloff.setter
    def falloff(self, arg: float, /) -> None: ...
    @property
    def hidden(self) -> bool: ...
    @hidden.setter
    def hidden(self, arg: bool, /) -> None: ...

    top: Sequence[float]

    up: Sequence[float]

    albedo: Sequence[float]

    emission: Sequence[float]

class TileMemory:
    def __init__(self, budget_bytes: int) -> None: ...
    @property
    def budget_bytes(self) -> int: ...
    @property
    def counts(self) -> dict[str, int]: ...
    def take_fault(self) -> str: ...

def write_tile_file(file: int, key: str, pixels: NDArray[numpy.float32], first_level: int) -> None: ...

class Scene:
    @property
    def memory_bytes(self) -> int: ...
    @property
    def has_instances(self) -> bool: ...
    @property
    def has_grouped(self) -> bool: ...
    @property
    def has_curves(self) -> bool: ...
    @property
    def has_spheres(self) -> bool: ...
    @property
    def has_attributes(self) -> bool: ...
    @property
    def has_inputs(self) -> bool: ...
    @property
    def has_cutouts(self) -> bool: ...
    @property
    def textures(self) -> int: ...
    @property
    def texture_bytes(self) -> int: ...
    @property
    def texture_images(self) -> list[dict[str, int]]: ...
    @property
    def has_emission(self) -> bool: ...
    @property
    def has_thin(self) -> bool: ...
    @property
    def emitters(self) -> int: ...
    @property
    def unsampled_emitters(self) -> int: ...
    @property
    def sampled_lights(self) -> int: ...
    @property
    def light_images(self) -> int: ...
    @property
    def geometry_lights(self) -> int: ...
    @property
    def has_portals(self) -> bool: ...
    @property
    def domes(self) -> int: ...
    @property
    def has_shaping(self) -> bool: ...
    @property
    def has_links(self) -> bool: ...
    @property
    def has_special_shadows(self) -> bool: ...
    @property
    def has_lobe_factors(self) -> bool: ...
    @property
    def placements(
        self,
    ) -> tuple[
        Annotated[NDArray[numpy.int32], {"shape": (None,)}],
        Annotated[NDArray[numpy.int32], {"shape": (None,)}],
        Annotated[NDArray[numpy.int32], {"shape": (None,)}],
        int,
    ]: ...
    @property
    def resolution(self) -> tuple[int, int]: ...
    @property
    def has_clipping_planes(self) -> bool: ...
    @property
    def has_moving_camera(self) -> bool: ...
    @property
    def has_moving_instances(self) -> bool: ...
    @property
    def has_moving_volumes(self) -> bool: ...
    @property
    def has_moving_points(self) -> bool: ...
    @property
    def has_moving_lights(self) -> bool: ...
    @property
    def media(self) -> int: ...
    @property
    def volumes(self) -> int: ...
    @property
    def has_lens(self) -> bool: ...

class KeptTextures:
    def __init__(self, arg: Scene, /) -> None: ...

class SceneBuilder:
    @overload
    def __init__(self, arg0: Sequence[float], arg1: float, /) -> None: ...
    @overload
    def __init__(self, arg: Scene, /) -> None: ...
    def keeps_means(self) -> bool: ...
    def drop_surfaces_and_lights(self) -> None: ...
    def release_coarse_textures(self) -> list[int]: ...
    def take_texture_images(self, arg0: int, arg1: KeptTextures, arg2: int, /) -> bool: ...
    def keep_domes(self, arg: KeptTextures, /) -> None: ...
    def set_primvar_names(self, arg: int, /) -> None: ...
    def add_surface(self, arg0: SurfaceInput, arg1: Sequence[InputSource], arg2: int, /) -> int: ...
    def add_tape(self, arg: Tape, /) -> int: ...
    def add_texture(self, arg0: int, arg1: bool, arg2: bool, /) -> int: ...
    def set_texture_image(self, arg0: int, arg1: int, arg2: NDArray[numpy.float32], /) -> None: ...
    def finest_texture_level(self, arg0: int, arg1: int, arg2: int, /) -> int: ...
    def set_texture_tiles(self, texture: int, tile: int, path: str, key: str, memory: TileMemory | None) -> None: ...
    def add_placement_primvar(self, arg0: int, arg1: int, arg2: NDArray[numpy.float32], /) -> None: ...
    def begin_prototype(self, arg0: Sequence[float], arg1: float, /) -> int: ...
    @property
    def mesh_rows(self) -> int: ...
    @property
    def curved_rows(self) -> int: ...
    @property
    def placement_rows(self) -> int: ...
    def reserve_triangles(self, arg0: int, arg1: int, /) -> None: ...
    def reserve_instances(self, arg: int, /) -> None: ...
    def begin_placement(self, arg0: int, arg1: int, /) -> None: ...
    def add_point_instances(
        self,
        outer: NDArray[numpy.float64] | None,
        positions: NDArray[numpy.float64],
        orientations: NDArray[numpy.float64] | None,
        scales: NDArray[numpy.float64] | None,
    ) -> Annotated[NDArray[numpy.int64], {"shape": (None,)}]: ...
    def add_instances(self, arg: NDArray[numpy.float64], /) -> Annotated[NDArray[numpy.int64], {"shape": (None,)}]: ...
    def add_moving_instances(
        self, arg0: NDArray[numpy.float32], arg1: bool, arg2: NDArray[numpy.float64], /
    ) -> Annotated[NDArray[numpy.int64], {"shape": (None,)}]: ...
    def set_fog(self, arg: FogInput, /) -> None: ...
    def set_exposure(self, arg0: float, arg1: float, arg2: float, /) -> None: ...
    def set_rolling_shutter(self, arg0: float, arg1: float, /) -> None: ...
    def end_placement(self) -> None: ...
    def set_links(self, arg: NDArray[numpy.uint8], /) -> None: ...
    def set_link_row(self, arg: int, /) -> None: ...
    def finish(self) -> Scene: ...
    def add_curves(self, arg0: CurvesInput, arg1: NDArray[numpy.float64], /) -> None: ...
    def add_mesh(self, arg0: MeshInput, arg1: NDArray[numpy.float64], /) -> None: ...
    def add_plain_meshes(
        self,
        points: Sequence[NDArray[numpy.float32]],
        triangles: Sequence[NDArray[numpy.int32]],
        surfaces: NDArray[numpy.int32],
        matrices: NDArray[numpy.float64],
    ) -> None: ...
    def replace_mesh(
        self, arg0: int, arg1: MeshInput, arg2: NDArray[numpy.float64], arg3: NDArray[numpy.float64], /
    ) -> bool: ...
    def add_mesh_primvar(self, arg0: int, arg1: PrimvarKind, arg2: int, arg3: NDArray[numpy.float32], /) -> None: ...
    def add_sphere(self, arg0: float, arg1: int, arg2: NDArray[numpy.float64], /) -> bool: ...
    def add_curved_primvar(self, arg0: int, arg1: PrimvarKind, arg2: int, arg3: NDArray[numpy.float32], /) -> None: ...
    def add_ies_profile(
        self, arg0: NDArray[numpy.float32], arg1: NDArray[numpy.float32], arg2: NDArray[numpy.float32], arg3: bool, /
    ) -> int: ...
    def add_light_image(self, arg: NDArray[numpy.float32], /) -> int: ...
    def add_light(self, arg0: LightInput, arg1: int, /) -> int | None: ...
    def add_geometry_light(self, arg: LightInput, /) -> int: ...
    def set_light_of_shape(self, arg0: int, arg1: NDArray[numpy.float64], /) -> None: ...
    def add_grid(
        self,
        leaf_origins: NDArray[numpy.int32],
        values: object,
        tiles: NDArray[numpy.int32],
        tile_values: object,
        channels: int = 1,
    ) -> int: ...
    def add_blurred_grid(self, grid: int, velocity: int, frame: float) -> int: ...
    def add_medium(self, arg: MediumInput, /) -> Annotated[NDArray[numpy.int64], {"shape": (None,)}]: ...
    def add_volume_emission(self, arg: VolumeEmissionInput, /) -> Annotated[NDArray[numpy.int64], {"shape": (None,)}]: ...
    def set_camera(self, arg: CameraInput, /) -> None: ...

def pattern_operations() -> list[str]: ...

PATTERN_REGISTERS: int = 1024

class PatternImage:
    def __init__(self) -> None: ...
    @property
    def color(self) -> int: ...
    @color.setter
    def color(self, arg: int, /) -> None: ...
    @property
    def alpha(self) -> int: ...
    @alpha.setter
    def alpha(self, arg: int, /) -> None: ...
    @property
    def wrap_s(self) -> Wrap: ...
    @wrap_s.setter
    def wrap_s(self, arg: Wrap, /) -> None: ...
    @property
    def wrap_t(self) -> Wrap: ...
    @wrap_t.setter
    def wrap_t(self, arg: Wrap, /) -> None: ...
    @property
    def closest(self) -> bool: ...
    @closest.setter
    def closest(self, arg: bool, /) -> None: ...
    @property
    def primvar(self) -> int: ...
    @primvar.setter
    def primvar(self, arg: int, /) -> None: ...

    st_transform: Sequence[float]

class Tape:
    def __init__(self) -> None: ...

    code: NDArray[numpy.int32]

    constants: Sequence[float]

    images: Sequence[PatternImage]

    outputs: NDArray[numpy.int32]

    @property
    def asks_object_space(self) -> bool: ...
    @asks_object_space.setter
    def asks_object_space(self, arg: bool, /) -> None: ...

class OpenPbrInput:
    def __init__(self) -> None: ...

    base_weight: float

    base_color: Sequence[float]

    base_diffuse_roughness: float

    base_metalness: float

    specular_weight: float

    specular_color: Sequence[float]

    specular_roughness: float

    specular_roughness_anisotropy: float

    specular_ior: float

    transmission_weight: float

    transmission_color: Sequence[float]

    transmission_depth: float

    transmission_scatter: Sequence[float]

    transmission_scatter_anisotropy: float

    transmission_dispersion_scale: float

    transmission_dispersion_abbe_number: float

    subsurface_weight: float

    subsurface_color: Sequence[float]

    subsurface_radius: float

    subsurface_radius_scale: Sequence[float]

    subsurface_scatter_anisotropy: float

    fuzz_weight: float

    fuzz_color: Sequence[float]

    fuzz_roughness: float

    coat_weight: float

    coat_color: Sequence[float]

    coat_roughness: float

    coat_roughness_anisotropy: float

    coat_ior: float

    coat_darkening: float

    coat_roughening: float

    thin_film_weight: float

    thin_film_thickness: float

    thin_film_ior: float

    tangent: Sequence[float]

class HairInput:
    def __init__(self) -> None: ...

    absorption: Sequence[float]

    tint_r: Sequence[float]

    tint_tt: Sequence[float]

    tint_trt: Sequence[float]

    variance_r: float

    variance_tt: float

    variance_trt: float

    scale_r: float

    scale_tt: float

    scale_trt: float

    ior: float

    cuticle_tilt: float

class VolumeInput:
    def __init__(self) -> None: ...
    @property
    def phase(self) -> float: ...
    @phase.setter
    def phase(self, arg: float, /) -> None: ...

    extinction: Sequence[float]

    scattering: Sequence[float]

    emission: Sequence[float]

class CameraVisibility(enum.Enum):
    seen = 0

    hidden = 1

    matte = 2

class SurfaceInput:
    def __init__(self) -> None: ...
    @property
    def lambert(self) -> bool: ...
    @lambert.setter
    def lambert(self, arg: bool, /) -> None: ...
    @property
    def use_specular_workflow(self) -> bool: ...
    @use_specular_workflow.setter
    def use_specular_workflow(self, arg: bool, /) -> None: ...
    @property
    def opacity_threshold(self) -> float: ...
    @opacity_threshold.setter
    def opacity_threshold(self, arg: float, /) -> None: ...
    @property
    def dielectric_priority(self) -> float: ...
    @dielectric_priority.setter
    def dielectric_priority(self, arg: float, /) -> None: ...
    @property
    def camera(self) -> CameraVisibility: ...
    @camera.setter
    def camera(self, arg: CameraVisibility, /) -> None: ...
    @property
    def presence(self) -> bool: ...
    @presence.setter
    def presence(self, arg: bool, /) -> None: ...
    @property
    def thin(self) -> bool: ...
    @thin.setter
    def thin(self, arg: bool, /) -> None: ...
    @property
    def interface(self) -> bool: ...
    @interface.setter
    def interface(self, arg: bool, /) -> None: ...

    open_pbr: OpenPbrInput

    hair: HairInput

    volume: VolumeInput

    diffuse_color: Sequence[float]

    emissive_color: Sequence[float]

    specular_color: Sequence[float]

    metallic: float

    roughness: float

    clearcoat: float

    clearcoat_roughness: float

    opacity: float

    ior: float

class InputSource:
    def __init__(self) -> None: ...
    @property
    def field(self) -> InputField: ...
    @field.setter
    def field(self, arg: InputField, /) -> None: ...
    @property
    def primvar(self) -> int: ...
    @primvar.setter
    def primvar(self, arg: int, /) -> None: ...
    @property
    def tangents(self) -> int: ...
    @tangents.setter
    def tangents(self, arg: int, /) -> None: ...
    @property
    def texture(self) -> int: ...
    @texture.setter
    def texture(self, arg: int, /) -> None: ...
    @property
    def output(self) -> int: ...
    @output.setter
    def output(self, arg: int, /) -> None: ...
    @property
    def wrap_s(self) -> Wrap: ...
    @wrap_s.setter
    def wrap_s(self, arg: Wrap, /) -> None: ...
    @property
    def wrap_t(self) -> Wrap: ...
    @wrap_t.setter
    def wrap_t(self, arg: Wrap, /) -> None: ...

    fallback: Sequence[float]

    st_transform: Sequence[float]

    scale: Sequence[float]

    bias: Sequence[float]

    missing: Sequence[float]

def boxes(arg: Sequence[NDArray[numpy.float32]], /) -> Annotated[NDArray[numpy.float64], {"shape": (None, None, None)}]: ...

class MeshInput:
    def __init__(self) -> None: ...
    @property
    def normal_kind(self) -> Attribute: ...
    @normal_kind.setter
    def normal_kind(self, arg: Attribute, /) -> None: ...
    @property
    def color_kind(self) -> Attribute: ...
    @color_kind.setter
    def color_kind(self, arg: Attribute, /) -> None: ...
    @property
    def cutout(self) -> bool: ...
    @cutout.setter
    def cutout(self, arg: bool, /) -> None: ...

    points: NDArray[numpy.float32]

    triangles: NDArray[numpy.int32]

    normals: NDArray[numpy.float32]

    colors: NDArray[numpy.float32]

    times: NDArray[numpy.float32]

    step_points: NDArray[numpy.float32]

    step_normals: NDArray[numpy.float32]

    surfaces: NDArray[numpy.int32]

class CurvesInput:
    def __init__(self) -> None: ...
    @property
    def closed(self) -> bool: ...
    @closed.setter
    def closed(self, arg: bool, /) -> None: ...
    @property
    def joined(self) -> bool: ...
    @joined.setter
    def joined(self, arg: bool, /) -> None: ...

    points: NDArray[numpy.float32]

    segments: NDArray[numpy.int32]

    surfaces: NDArray[numpy.int32]

    times: NDArray[numpy.float32]

    step_points: NDArray[numpy.float32]

class ShapingInput:
    def __init__(self) -> None: ...
    @property
    def focus(self) -> float: ...
    @focus.setter
    def focus(self, arg: float, /) -> None: ...
    @property
    def cone_angle_deg(self) -> float: ...
    @cone_angle_deg.setter
    def cone_angle_deg(self, arg: float, /) -> None: ...
    @property
    def cone_softness(self) -> float: ...
    @cone_softness.setter
    def cone_softness(self, arg: float, /) -> None: ...
    @property
    def ies(self) -> int: ...
    @ies.setter
    def ies(self, arg: int, /) -> None: ...
    @property
    def ies_angle_scale(self) -> float: ...
    @ies_angle_scale.setter
    def ies_angle_scale(self, arg: float, /) -> None: ...
    @property
    def ies_divisor(self) -> float: ...
    @ies_divisor.setter
    def ies_divisor(self, arg: float, /) -> None: ...

    focus_tint: Sequence[float]

class LightInput:
    def __init__(self) -> None: ...
    @property
    def type(self) -> LightType: ...
    @type.setter
    def type(self, arg: LightType, /) -> None: ...
    @property
    def width(self) -> float: ...
    @width.setter
    def width(self, arg: float, /) -> None: ...
    @property
    def height(self) -> float: ...
    @height.setter
    def height(self, arg: float, /) -> None: ...
    @property
    def radius(self) -> float: ...
    @radius.setter
    def radius(self, arg: float, /) -> None: ...
    @property
    def length(self) -> float: ...
    @length.setter
    def length(self, arg: float, /) -> None: ...
    @property
    def angle_deg(self) -> float: ...
    @angle_deg.setter
    def angle_deg(self, arg: float, /) -> None: ...
    @property
    def diffuse(self) -> float: ...
    @diffuse.setter
    def diffuse(self, arg: float, /) -> None: ...
    @property
    def specular(self) -> float: ...
    @specular.setter
    def specular(self, arg: float, /) -> None: ...
    @property
    def light_link(self) -> int: ...
    @light_link.setter
    def light_link(self, arg: int, /) -> None: ...
    @property
    def group(self) -> int: ...
    @group.setter
    def group(self, arg: int, /) -> None: ...
    @property
    def shadow_link(self) -> int: ...
    @shadow_link.setter
    def shadow_link(self, arg: int, /) -> None: ...
    @property
    def visible_to_camera(self) -> bool: ...
    @visible_to_camera.setter
    def visible_to_camera(self, arg: bool, /) -> None: ...
    @property
    def casts_shadows(self) -> bool: ...
    @casts_shadows.setter
    def casts_shadows(self, arg: bool, /) -> None: ...
    @property
    def shadow_distance(self) -> float: ...
    @shadow_distance.setter
    def shadow_distance(self, arg: float, /) -> None: ...
    @property
    def shadow_falloff(self) -> float: ...
    @shadow_falloff.setter
    def shadow_falloff(self, arg: float, /) -> None: ...
    @property
    def shadow_gamma(self) -> float: ...
    @shadow_gamma.setter
    def shadow_gamma(self, arg: float, /) -> None: ...
    @property
    def format(self) -> DomeFormat: ...
    @format.setter
    def format(self, arg: DomeFormat, /) -> None: ...
    @property
    def earlier_dome(self) -> int: ...
    @earlier_dome.setter
    def earlier_dome(self, arg: int, /) -> None: ...
    @property
    def shaping(self) -> ShapingInput | None: ...
    @shaping.setter
    def shaping(self, arg: ShapingInput | None, /) -> None: ...
    @property
    def own_color(self) -> bool: ...
    @own_color.setter
    def own_color(self, arg: bool, /) -> None: ...
    @property
    def shows_own(self) -> bool: ...
    @shows_own.setter
    def shows_own(self, arg: bool, /) -> None: ...
    @property
    def normalize(self) -> bool: ...
    @normalize.setter
    def normalize(self, arg: bool, /) -> None: ...

    texture: NDArray[numpy.float32]

    portals: NDArray[numpy.float64]

    def set_portal_motion(self, arg0: int, arg1: NDArray[numpy.float32], arg2: NDArray[numpy.float64], /) -> None: ...

    times: NDArray[numpy.float32]

    pose_matrices: NDArray[numpy.float64]

    world_from_light: NDArray[numpy.float64]

    emission: Sequence[float]

    shadow_color: Sequence[float]

class MediumInput:
    def __init__(self) -> None: ...
    @property
    def grid(self) -> int: ...
    @grid.setter
    def grid(self, arg: int, /) -> None: ...
    @property
    def albedo_grid(self) -> int: ...
    @albedo_grid.setter
    def albedo_grid(self, arg: int, /) -> None: ...
    @property
    def phase(self) -> float: ...
    @phase.setter
    def phase(self, arg: float, /) -> None: ...
    @property
    def camera(self) -> CameraVisibility: ...
    @camera.setter
    def camera(self, arg: CameraVisibility, /) -> None: ...

    extinction: Sequence[float]

    albedo: Sequence[float]

    world_from_index: NDArray[numpy.float64]

    times: NDArray[numpy.float32]

    turns: bool

class VolumeEmissionInput:
    def __init__(self) -> None: ...
    @property
    def grid(self) -> int: ...
    @grid.setter
    def grid(self, arg: int, /) -> None: ...
    @property
    def camera(self) -> CameraVisibility: ...
    @camera.setter
    def camera(self, arg: CameraVisibility, /) -> None: ...

    emission: Sequence[float]

    world_from_index: NDArray[numpy.float64]

    times: NDArray[numpy.float32]

    turns: bool

class DistortionInput:
    def __init__(self) -> None: ...
    @property
    def model(self) -> str: ...
    @model.setter
    def model(self, arg: str, /) -> None: ...
    @property
    def most_angle(self) -> float: ...
    @most_angle.setter
    def most_angle(self, arg: float, /) -> None: ...
    @property
    def table_columns(self) -> int: ...
    @table_columns.setter
    def table_columns(self, arg: int, /) -> None: ...
    @property
    def table_rows(self) -> int: ...
    @table_rows.setter
    def table_rows(self, arg: int, /) -> None: ...

    table_window: Sequence[float]

    coefficients: NDArray[numpy.float64]

    directions: NDArray[numpy.float32]

    places: NDArray[numpy.float32]

class CameraInput:
    def __init__(self) -> None: ...
    @property
    def orthographic(self) -> bool: ...
    @orthographic.setter
    def orthographic(self, arg: bool, /) -> None: ...
    @property
    def near(self) -> float: ...
    @near.setter
    def near(self, arg: float, /) -> None: ...
    @property
    def far(self) -> float: ...
    @far.setter
    def far(self, arg: float, /) -> None: ...
    @property
    def lens_radius(self) -> float: ...
    @lens_radius.setter
    def lens_radius(self, arg: float, /) -> None: ...
    @property
    def focus_distance(self) -> float: ...
    @focus_distance.setter
    def focus_distance(self, arg: float, /) -> None: ...
    @property
    def blades(self) -> int: ...
    @blades.setter
    def blades(self, arg: int, /) -> None: ...
    @property
    def blade_rotation_deg(self) -> float: ...
    @blade_rotation_deg.setter
    def blade_rotation_deg(self, arg: float, /) -> None: ...
    @property
    def width(self) -> int: ...
    @width.setter
    def width(self, arg: int, /) -> None: ...
    @property
    def height(self) -> int: ...
    @height.setter
    def height(self, arg: int, /) -> None: ...
    @property
    def filter_width(self) -> float: ...
    @filter_width.setter
    def filter_width(self, arg: float, /) -> None: ...

    pixels: Sequence[int]

    @property
    def natural_vignetting(self) -> bool: ...
    @natural_vignetting.setter
    def natural_vignetting(self, arg: bool, /) -> None: ...
    @property
    def rim_distance(self) -> float: ...
    @rim_distance.setter
    def rim_distance(self, arg: float, /) -> None: ...
    @property
    def rim_radius(self) -> float: ...
    @rim_radius.setter
    def rim_radius(self, arg: float, /) -> None: ...

    distortion: DistortionInput

    magnification: Sequence[float]

    focus_shift: Sequence[float]

    world_from_camera: NDArray[numpy.float64]

    window: Sequence[float]

    clipping_planes: NDArray[numpy.float64]

    times: NDArray[numpy.float32]

    pose_matrices: NDArray[numpy.float64]

    pose_numbers: NDArray[numpy.float64]

    filter_inverse_cdf: NDArray[numpy.float32]

REPLICATES: int = 2

def exact_sum(terms: NDArray[numpy.float32], group: int) -> tuple[int, int, int, float]: ...

class FrameErrorSums:
    @property
    def values(self) -> int: ...
    @property
    def relative_alone(self) -> float: ...
    @property
    def relative_alike(self) -> float: ...
    @property
    def relative(self) -> float: ...
    @property
    def relative_plain(self) -> float: ...
    @property
    def relative_variance(self) -> float: ...
    @property
    def squared(self) -> float: ...
    @property
    def squared_variance(self) -> float: ...
    @property
    def tiles(self) -> Annotated[NDArray[numpy.float64], {"shape": (None,)}]: ...
    @property
    def pixels(self) -> Annotated[NDArray[numpy.float32], {"shape": (None,)}]: ...

class Film:
    def __init__(
        self,
        width: int,
        height: int,
        expressions: int = 0,
        removals: int = 0,
        deep_tolerance: float = 0.0,
        deep_samples: int = 0,
    ) -> None: ...
    @staticmethod
    def from_state(width: int, height: int, state: dict[str, NDArray[Any]]) -> Film: ...
    def state(self) -> dict[str, NDArray[Any]]: ...
    def merge(self, other: Film) -> None: ...
    def start_at(self, first: int) -> None: ...
    def image(
        self, exposure: float
    ) -> tuple[
        Annotated[NDArray[numpy.float32], {"shape": (None, None, None)}],
        Annotated[NDArray[numpy.float32], {"shape": (None, None, None)}],
    ]: ...
    def lpe_images(
        self, exposure: float
    ) -> tuple[
        Annotated[NDArray[numpy.float64], {"shape": (None, None, None, None)}],
        Annotated[NDArray[numpy.float32], {"shape": (None, None, None, None)}],
    ]: ...
    def removed_rows(
        self, why: int, exposure: float, first: int, end: int
    ) -> tuple[
        Annotated[NDArray[numpy.float64], {"shape": (None, None, None)}],
        Annotated[NDArray[numpy.float64], {"shape": (None, None, None)}],
    ]: ...
    def deep_samples(
        self, exposure: float
    ) -> tuple[
        Annotated[NDArray[numpy.uint32], {"shape": (None, None)}], Annotated[NDArray[numpy.float32], {"shape": (None, None)}]
    ]: ...
    @property
    def deep_memory_bytes(self) -> int: ...
    @property
    def expressions(self) -> int: ...
    def error(
        self, exposure: float, most_pixels: int, threads: int, mix: NDArray[numpy.float64], by_pixel: bool = False
    ) -> FrameErrorSums:
        """Sums over pixels and colours; see film/frame_error.hpp."""

    @property
    def replicates(self) -> Annotated[NDArray[numpy.float64], {"shape": (None, None, None, None)}]: ...
    @property
    def counts(self) -> Annotated[NDArray[numpy.uint32], {"shape": (None, None, None)}]: ...
    @property
    def next(self) -> Annotated[NDArray[numpy.uint32], {"shape": (None, None)}]: ...
    @property
    def tile_rays(self) -> Annotated[NDArray[numpy.int64], {"shape": (None,)}]: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def tiles_x(self) -> int: ...
    @property
    def tiles_y(self) -> int: ...
    @property
    def samples(self) -> int: ...
    @property
    def camera_rays(self) -> int: ...
    @property
    def scattered_rays(self) -> int: ...
    @property
    def shadow_rays(self) -> int: ...
    @property
    def unseen_walks(self) -> dict[int, float]: ...
    @property
    def invalid_samples(self) -> int: ...

class PassStatistics:
    @property
    def interrupted(self) -> bool: ...
    @property
    def busy_lanes(self) -> int: ...
    @property
    def shaded_lanes(self) -> int: ...
    @property
    def seconds(self) -> float: ...

def choose_splits(scene: Scene, settings: IntegratorSettings, lanes: int) -> tuple[int, int]: ...
def render_pass(
    scene: Scene,
    film: Film,
    ends: NDArray[numpy.uint32],
    settings: IntegratorSettings,
    lanes: int,
    progress: Callable[[float], bool | None] | None | None = None,
) -> PassStatistics: ...
def log_pixel(
    scene: Scene, settings: IntegratorSettings, x: int, y: int, first: tuple[int, int], end: tuple[int, int], brightest: int
) -> list[dict[str, Any]]: ...
def shape_of_light(scene: Scene, light: int) -> tuple[int, int]: ...

class Guide:
    @property
    def regions(self) -> int: ...
    @property
    def alone(self) -> bool: ...
    @property
    def share(self) -> float: ...
    @property
    def memory_bytes(self) -> int: ...

def learn_guide(scene: Scene, settings: IntegratorSettings, lanes: int) -> Guide: ...
def has_lanes(arg: int, /) -> bool: ...

class Recording:
    def __init__(self, arg0: Scene, arg1: int, arg2: IntegratorSettings, arg3: int, /) -> None: ...
    def replay_seconds(self) -> float: ...
    @property
    def times(
        self,
    ) -> tuple[Annotated[NDArray[numpy.uint8], {"shape": (None,)}], Annotated[NDArray[numpy.float32], {"shape": (None,)}]]: ...

class FirstHits:
    def __init__(
        self,
        scene: Scene,
        names: Sequence[str],
        primvars: Sequence[tuple[int, int, int]],
        replicate: int = 0,
        occlusion_distance: float = 0.0,
    ) -> None: ...
    def fill(self, lanes: int, threads: int, first_row: int, end_row: int) -> None: ...
    def want_coverage(
        self, seed: int, screen_block: int, first_link: int, first: NDArray[numpy.uint32], end: NDArray[numpy.uint32]
    ) -> None: ...
    def take_coverage(
        self,
    ) -> tuple[
        Annotated[NDArray[numpy.uint32], {"shape": (None, None)}],
        Annotated[NDArray[numpy.int32], {"shape": (None, None)}],
        Annotated[NDArray[numpy.int64], {"shape": (None,)}],
    ]: ...
    def take(self) -> dict[str, NDArray[Any]]: ...
    def take_primvars(self) -> list[Annotated[NDArray[numpy.float32], {"shape": (None, None, None)}]]: ...
    @staticmethod
    def widths_of_planes() -> dict[str, int]: ...

class NumberedLayers:
    def parts(self) -> Annotated[NDArray[numpy.int32], {"shape": (None, None)}]: ...
    def first(self) -> Annotated[NDArray[numpy.int32], {"shape": (None,)}]: ...
    def depth(self) -> Annotated[NDArray[numpy.float32], {"shape": (None,)}]: ...
    def count_rays(
        self, places: NDArray[numpy.int32], parents: NDArray[numpy.int32]
    ) -> tuple[Annotated[NDArray[numpy.int64], {"shape": (None,)}], Annotated[NDArray[numpy.int64], {"shape": (None,)}]]: ...
    def rays_passing(
        self, places: NDArray[numpy.int32], parents: NDArray[numpy.int32]
    ) -> Annotated[NDArray[numpy.int32], {"shape": (None, None)}]: ...

def numbered_layers(
    scene: Scene, positions: NDArray[numpy.float32], first_only: bool, lanes: int, threads: int
) -> NumberedLayers: ...
def layers(
    scene: Scene, positions: NDArray[numpy.float32], first_only: bool, lanes: int, threads: int
) -> tuple[
    Annotated[NDArray[numpy.uint32], {"shape": (None,)}],
    Annotated[NDArray[numpy.int32], {"shape": (None, None)}],
    Annotated[NDArray[numpy.float32], {"shape": (None, None)}],
]: ...
def returns(
    scene: Scene,
    origins: NDArray[numpy.float64],
    directions: NDArray[numpy.float64],
    times: NDArray[numpy.float32],
    reach: tuple[float, float],
    weights: tuple[float, float, float],
    least_alpha: float,
    least_strength: float,
    lanes: int,
    threads: int,
) -> tuple[
    Annotated[NDArray[numpy.uint32], {"shape": (None,)}],
    Annotated[NDArray[numpy.int32], {"shape": (None, None)}],
    Annotated[NDArray[numpy.float64], {"shape": (None,)}],
    Annotated[NDArray[numpy.float32], {"shape": (None, None)}],
]: ...
def project(scene: Scene, points: NDArray[numpy.float64]) -> Annotated[NDArray[numpy.float64], {"shape": (None, None)}]: ...
def parts_of_groups(scene: Scene) -> Annotated[NDArray[numpy.int32], {"shape": (None, None)}]: ...
def surface_of_part(
    scene: Scene, shape: int, instance: int, outer: int
) -> tuple[
    Annotated[NDArray[numpy.float64], {"shape": (None, None)}], Annotated[NDArray[numpy.uint32], {"shape": (None, None)}]
]: ...
def extents(
    scene: Scene, parts: NDArray[numpy.int32], axes: NDArray[numpy.float64], threads: int
) -> tuple[
    Annotated[NDArray[numpy.float64], {"shape": (None, None)}],
    Annotated[NDArray[numpy.float64], {"shape": (None,)}],
    Annotated[NDArray[numpy.float64], {"shape": (None, None, None)}],
    Annotated[NDArray[numpy.int64], {"shape": (None,)}],
]: ...

class Displacer:
    def __init__(self) -> None: ...
    def add_tape(self, arg: Tape, /) -> int: ...
    def add_surface(self, arg0: SurfaceInput, arg1: Sequence[InputSource], arg2: int, /) -> int: ...
    def add_texture(self, arg0: int, arg1: bool, arg2: bool, /) -> int: ...
    def set_texture_image(self, arg0: int, arg1: int, arg2: NDArray[numpy.float32], /) -> None: ...
    def set_primvar_names(self, arg: int, /) -> None: ...
    def set_directions(self, arg: Sequence[int], /) -> None: ...

class DicedCage:
    @property
    def points(self) -> Annotated[NDArray[numpy.float32], {"shape": (None, None)}]: ...
    @property
    def normals(self) -> Annotated[NDArray[numpy.float32], {"shape": (None, None)}]: ...
    @property
    def vertex_values(self) -> Annotated[NDArray[numpy.float32], {"shape": (None, None)}]: ...
    @property
    def varying_values(self) -> Annotated[NDArray[numpy.float32], {"shape": (None, None)}]: ...
    @property
    def step_points(self) -> list[Annotated[NDArray[numpy.float32], {"shape": (None, None)}]]: ...
    @property
    def step_normals(self) -> list[Annotated[NDArray[numpy.float32], {"shape": (None, None)}]]: ...
    @property
    def face_varying(
        self,
    ) -> list[
        tuple[
            Annotated[NDArray[numpy.int32], {"shape": (None, None)}], Annotated[NDArray[numpy.float32], {"shape": (None, None)}]
        ]
    ]: ...
    @property
    def triangles(self) -> Annotated[NDArray[numpy.int32], {"shape": (None, None)}]: ...
    @property
    def normal_indices(self) -> Annotated[NDArray[numpy.int32], {"shape": (None, None)}]: ...
    @property
    def faces(self) -> Annotated[NDArray[numpy.int32], {"shape": (None,)}]: ...
    @property
    def level(self) -> int: ...
    @property
    def level_limited(self) -> bool: ...
    @property
    def non_manifold_edges(self) -> int: ...
    @property
    def unknown_creases(self) -> int: ...

def dice(cage: dict[str, object]) -> DicedCage | None: ...
def estimated_triangles(cage: dict[str, object]) -> int: ...
def triangulate(
    points: NDArray[numpy.float32],
    counts: NDArray[numpy.int32],
    indices: NDArray[numpy.int32],
    keep: NDArray[numpy.bool_] | None = None,
) -> (
    tuple[
        Annotated[NDArray[numpy.int32], {"shape": (None, None)}],
        Annotated[NDArray[numpy.int32], {"shape": (None, None)}],
        Annotated[NDArray[numpy.int32], {"shape": (None,)}],
        int,
    ]
    | None
):
    """
    Triangulate polygonal faces as primray/usd/mesh/triangulate.py does; None if some have to be left out.
    """

class CausticGuide:
    @property
    def photons(self) -> int: ...
    @property
    def sharp(self) -> float: ...
    @property
    def memory_bytes(self) -> int: ...

def learn_caustics(
    scene: Scene, max_depth: int, threads: int, lanes: int, cancel: Cancellation | None = None
) -> CausticGuide: ...
