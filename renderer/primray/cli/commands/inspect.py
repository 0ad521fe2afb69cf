"""`primray inspect`: what a stage would render, without rendering it.

The facts are printed as text, a name and a value per line with long lists truncated unless verbose, or as JSON.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...diagnostic_messages import diagnostics_lines, fidelity_text
from ...settings import RenderSettings
from .. import option_values
from ..flags import CONTENTS, FRAMES, LIGHTING, REFUSAL, SIZE, SURFACES, VIEWPOINT, frames_in, in_order, setting_values


@in_order(
    *("scene", *VIEWPOINT, *SIZE, *FRAMES, "rendering_color_space", *LIGHTING, *CONTENTS, *SURFACES, "lens_flaws"),
    *("json", "verbose", *REFUSAL),
)
def inspect(
    scene: str,
    json: bool = False,
    verbose: bool = False,
    **given: Any,
) -> None:
    """Print a stage's contents and what would be rendered: layers, cameras, products, counts, memory, diagnostics."""
    from ...diagnosis.inspection import facts_of
    from ..console import print_line

    time_code = option_values.one_frame_of(frames_in(given, scene), "inspect")
    settings = RenderSettings(**setting_values(given), time_code=time_code)
    facts, diagnostics = facts_of(scene, settings)
    if json:
        print_line(facts)
    else:
        print("\n".join(lines(facts, verbose)))
    diagnostics.raise_if_refused(settings.refusal)


_SHOWN = 10  # entries per list, unless verbose

Row = tuple[str, str]


def lines(facts: dict[str, Any], verbose: bool) -> list[str]:
    shown = None if verbose else _SHOWN
    rows = [
        *_stage_rows(facts["stage"], shown),
        *camera_rows(facts, shown),
        *_output_rows(facts["outputs"], shown),
        *_motion_rows(facts["motion"]),
        *_listed("light", [_light(light) for light in facts["lights"]], shown),
        *_listed("material", facts["materials"], shown),
        *_listed("texture", [_texture(texture) for texture in facts["textures"]], shown),
        *_listed("volume", [_volume(volume) for volume in facts["volumes"]], shown),
        *_counted("primvars", facts["primvars"], "shape"),
        *_count_rows(facts["counts"]),
        ("fidelity", fidelity_text(facts["diagnostics"])),
    ]
    indent = max(len(name) for name, _ in rows) + 2
    of_products = [row for row in facts["outputs"]["diagnostics"] if row not in facts["diagnostics"]]
    told = diagnostics_lines([*facts["diagnostics"], *of_products], verbose=verbose)
    return [f"{name:{indent}}{text}" for name, text in rows] + told


def _stage_rows(stage: dict[str, Any], shown: int | None) -> Iterator[Row]:
    yield from _listed("layer", stage["layers"], shown)
    default = f", default prim {stage['default_prim']}" if stage["default_prim"] else ""
    yield "stage", f"{stage['up_axis']} up, {stage['meters_per_unit']:g} m a unit{default}"
    yield "time", _time(stage["time"])
    variants = [f"{v['prim']}:{v['set']}={v['selection']} ({', '.join(v['names'])})" for v in stage["variants"]]
    yield from _listed("variant", variants, shown)
    payloads = stage["payloads"]
    if payloads["loaded"] or payloads["unloaded"]:
        yield "payloads", f"{len(payloads['loaded'])} loaded, {len(payloads['unloaded'])} not loaded"
        yield from _listed("not loaded", payloads["unloaded"], shown)
    yield from _counted("prims", stage["prim_types"], "")
    yield from _counted("purposes", stage["purposes"], "shape")
    if stage["native_instances"]:
        yield "native instances", f"{stage['native_instances']:,} of {stage['native_prototypes']:,} prototypes"
    instancers = [f"{i['path']}: {i['instances']:,} of {len(i['prototypes'])} prototypes" for i in stage["point_instancers"]]
    yield from _listed("point instancer", instancers, shown)
    yield from _listed("draw mode", [f"{mode['prim']}: {mode['mode']}" for mode in stage["draw_modes"]], shown)


def _time(time: dict[str, Any]) -> str:
    span = "no range authored" if time["start"] is None else f"{time['start']:g} to {time['end']:g}"
    sampled = "nothing sampled" if time["sampled"] is None else "samples from {:g} to {:g}".format(*time["sampled"])
    return f"{span}, {time['time_codes_per_second']:g} codes a second, {sampled}"


def camera_rows(facts: dict[str, Any], shown: int | None) -> Iterator[Row]:
    camera = facts["camera"]
    width, height = camera["resolution"]
    yield "camera", f"{camera['path'] or 'automatic'} ({camera['projection']}), {width} x {height}"
    pixels = camera["pixels"]
    if (pixels["x"], pixels["y"], pixels["width"], pixels["height"]) != (0, 0, width, height):
        yield "data window", f"{pixels['width']} x {pixels['height']} pixels from ({pixels['x']}, {pixels['y']})"
    if camera["pixel_aspect_ratio"] != 1:
        yield "pixel aspect", f"{camera['pixel_aspect_ratio']:g}"
    yield from _listed("", [f"also {path}" for path in facts["cameras"] if path != camera["path"]], shown)


def _output_rows(outputs: dict[str, Any], shown: int | None) -> Iterator[Row]:
    settings = [f"{s['path']}{'' if s['followed'] else ', not followed'}" for s in outputs["render_settings"]]
    yield from _listed("render settings", settings, shown)
    yield from _listed("stage asks", [_asked(one) for one in outputs["settings_taken"]], shown)
    yield from _listed("product", [_product(product) for product in outputs["products"]], shown)
    passes = [p["path"] + (f", from {p['render_settings']}" if p["render_settings"] else "") for p in outputs["render_passes"]]
    yield from _listed("render pass", passes, shown)


def _product(product: dict[str, Any]) -> str:
    variables = ", ".join(variable["name"] for variable in product["variables"])
    view = product["view"]
    shown = "" if view is None else f", shown as {_view(view)}"
    return f"{product['path']} to {product['file']}: {variables or 'the picture'}{shown}"


def _asked(one: dict[str, Any]) -> str:
    value = f"{one['value']:g}" if isinstance(one["value"], float) else one["value"]
    return f"{one['setting']} {value}, by {one['prim']}.{one['attribute']}"


def _view(view: dict[str, Any]) -> str:
    names = [view[name] for name in ("view", "display", "look") if view[name] is not None]
    return ", ".join(names or ["the default view"]) + (f" at {view['exposure']:+g} stops" if view["exposure"] else "")


def _motion_rows(motion: dict[str, Any] | None) -> Iterator[Row]:
    if motion is None:
        return
    yield "shutter", "{:g} to {:g} time codes from the frame".format(*motion["shutter"])
    for kind, found in motion["moving"].items():
        steps = f"{found['segments']} step{'s' if found['segments'] > 1 else ''}, for its {found['why']}"
        yield "moving", f"{kind} {found['count']:,}: {found['path']} in {steps}"


def _light(light: dict[str, Any]) -> str:
    emission = " ".join(f"{v:.4g}" for v in light["emission"])
    return f"{light['path']} ({light['type']}), {emission}{', ' + light['texture'] if light['texture'] else ''}"


def _texture(texture: dict[str, Any]) -> str:
    size = texture["size"]
    return f"{texture['path']}: {'cannot be read' if size is None else '{} x {}, {} channels'.format(*size)}"


def _volume(volume: dict[str, Any]) -> str:
    grids = [
        f"{grid['name']} {grid['voxels']:,} voxels"
        + ("" if grid["size"] is None else " in {} x {} x {}".format(*grid["size"]))
        + _voxel_size(grid["voxel_size"])
        + f", {grid['bytes'] / 2**20:,.1f} MiB"
        for grid in volume["grids"]
    ]
    count = volume["instances"]
    where = "" if volume["box"] is None else ", from ({}) to ({})".format(*(_numbers(corner) for corner in volume["box"]))
    return f"{volume['path']}{f' ({count:,} instances)' if count > 1 else ''}{where}: {'; '.join(grids)}"


def _voxel_size(size: list[float] | None) -> str:
    """Return the lengths of a voxel's edges in scene units, once if they are alike."""
    if size is None:
        return ""
    alike = max(size) - min(size) <= 1e-6 * max(size)
    return f" of {size[0]:.4g}" if alike else f" of {' x '.join(f'{edge:.4g}' for edge in size)}"


def _numbers(values: list[float]) -> str:
    return ", ".join(f"{value + 0.0:.5g}" for value in values)


def _listed(name: str, texts: list[str], shown: int | None) -> Iterator[Row]:
    for text in texts[:shown]:
        yield name, text
    if shown is not None and len(texts) > shown:
        yield "", f"and {len(texts) - shown} more"


def _counted(name: str, counter: dict[str, int], what: str) -> Iterator[Row]:
    if counter:
        texts = [
            f"{key} {count:,}{f' {what}s' if what and count > 1 else f' {what}' if what else ''}"
            for key, count in counter.items()
        ]
        yield name, ", ".join(texts)


def _count_rows(counted: dict[str, int]) -> Iterator[Row]:
    for name, value in counted.items():
        if name.endswith("_bytes"):
            yield name.removesuffix("_bytes").replace("_", " "), f"{value / 2**20:.1f} MiB"
        else:
            yield name.replace("_", " "), f"{value:,}"
