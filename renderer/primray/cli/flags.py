"""Flags of commands as plain data: those of settings, from the rows of RenderSettings, and those that are no settings.

The options of Typer (app.py) and the table of the quick parser (quick.py) are made of them. A command takes the flags
that it reads itself as parameters, and those of settings as keywords, of which `setting_values` makes values of settings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from ..settings import RenderSettings, rows
from ..settings.forms import form_of
from ..settings.setting import OPENING, PICTURES, Flag, OnOff, Row
from . import option_values
from .option_values import ColorCorrection, Complexity

RENDER = frozenset({"render"})
# Flags and arguments that are no settings, by the parameters of commands. Commands beside these have them as parameters.
FLAGS: dict[str, Flag] = {
    "scene": Flag((), "The USD stage: usda, usdc, usd or usdz.", str, metavar="SCENE", shown=False),
    "output": Flag((), "Output file, like -o.", str, metavar="[OUTPUT]", shown=False, commands=RENDER),
    "image_width": Flag(
        ("--imageWidth", "-w"),
        "Width in pixels; the height follows from the camera's aspect ratio.",
        int,
        metavar="W",
        shown=False,
    ),
    "frames": Flag(
        ("--frames", "--frame", "-f"),
        "Time codes to render: 1, 1:10, 1-10x2, 1:10:2, 1,5 or start:end; inspect, estimate and explain take one.",
        str,
        metavar="LIST",
        shown="default time",
    ),
    "frame_count": Flag(
        ("--frame-count", "-n"),
        "Number of frames, starting at --frame (default 1).",
        int,
        metavar="N",
        shown=False,
        commands=OPENING - {"view"},
    ),
    "frame_inc": Flag(
        ("--frame-inc", "-i"), "Step between frames.", float, metavar="N", shown="1", commands=OPENING - {"view"}
    ),
    "default_time": Flag(
        ("--defaultTime", "-d"), "Render the stage's default time, as without --frames.", bool, commands=OPENING - {"view"}
    ),
    "no_payloads": Flag(("--no-payloads",), "Load no payloads.", bool),
    "complexity": Flag(
        ("--complexity",), "Dicing rate of 16, 8, 4 or 2 pixels, instead of --dicing-rate.", Complexity, shown=False
    ),
    "ray": Flag(
        ("--ray",),
        "Split the samples over the nodes of a Ray cluster: HOST:PORT, or auto on one of its nodes.",
        str,
        metavar="ADDRESS",
        shown=False,
        commands=RENDER,
    ),
    "debug_pixel": Flag(
        ("--debug-pixel",),
        "Print what happens to the samples of one pixel, from the left and the top, in place of a picture.",
        tuple[int, int],
        metavar="X Y",
        shown=False,
        commands=RENDER,
    ),
    "profile": Flag(
        ("--profile",),
        "Write a trace of where the time goes, which https://ui.perfetto.dev opens.",
        str,
        metavar="FILE",
        shown=False,
        commands=RENDER,
    ),
    "pilot_seconds": Flag(
        ("--pilot",),
        "Seconds of sampling for the pilot render.",
        float,
        metavar="S",
        commands=frozenset({"estimate", "doctor"}),
    ),
    "outputs": Flag(
        ("--output", "-o"),
        "Output file: EXR, PNG, JPEG, TIFF or HDR; - for standard output (png:- for a PNG), or tev://HOST:PORT; may be "
        "repeated.",
        list[str],
        metavar="FILE",
        shown="<scene>.exr",
        commands=RENDER,
    ),
    "product": Flag(
        ("--product", "--products"),
        "Path or name of a RenderProduct to render to its own file; may be repeated.",
        list[str],
        metavar="PRIM",
        shown="the first",
        commands=PICTURES,
    ),
    "all_products": Flag(
        ("--all-products",), "Render every product of the RenderSettings to its own file.", bool, commands=PICTURES
    ),
    "output_dir": Flag(
        ("--output-dir",),
        "Folder for products with relative file names; folders are created.",
        str,
        metavar="DIR",
        shown="the current folder",
        commands=RENDER,
    ),
    "record": Flag(
        ("--record",), "Add the picture and its standard errors to products that do not order them.", bool, commands=RENDER
    ),
    "view": Flag(
        ("--view",), "OCIO view for PNG, JPEG and TIFF.", str, metavar="NAME", shown="the display's default", commands=PICTURES
    ),
    "display": Flag(
        ("--display",),
        "OCIO display for PNG, JPEG and TIFF.",
        str,
        metavar="NAME",
        shown="the configuration's default",
        commands=PICTURES,
    ),
    "look": Flag(
        ("--look",),
        "OCIO look for PNG, JPEG and TIFF, instead of the view's.",
        str,
        metavar="NAME",
        shown="the view's",
        commands=PICTURES,
    ),
    "color_correction": Flag(
        ("--colorCorrectionMode", "-color"),
        "View by usdrecord's names, instead of --view: Raw, Un-tone-mapped, or the default.",
        ColorCorrection,
        commands=RENDER,
    ),
    "make_output_path": Flag(("--make-output-path",), "Create the folders of output files.", bool, commands=RENDER),
    "snapshot": Flag(
        ("--snapshot",), "Write the unfinished picture every S seconds.", float, metavar="S", shown=False, commands=RENDER
    ),
    "exposure": Flag(
        ("--exposure",),
        "Exposure of PNG, JPEG and TIFF; auto: computed from the first frame, for all frames.",
        str,
        metavar="STOPS",
        shown="the product's, else 0",
        commands=PICTURES,
    ),
    "bit_depth": Flag(
        ("--bit-depth",),
        "Bits per channel of PNG (8, 16) and TIFF (16, 8; 32: scene-linear floats).",
        int,
        metavar="N",
        shown="8; TIFF 16",
        commands=RENDER,
    ),
    "half": Flag(
        ("--half",),
        "Channels, layers or parts of an EXR to store as halves (R, stderr, rgba), all or none, separated by commas; may be "
        "repeated.",
        list[str],
        metavar="NAMES",
        shown="floats",
        commands=PICTURES,
    ),
    "compression": Flag(
        ("--compression",),
        "Compression of an EXR: none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa or dwab; level for zip or DWA.",
        str,
        metavar="NAME[:LEVEL]",
        shown="the product's, else zip",
        commands=PICTURES,
    ),
    "metadata": Flag(
        ("--metadata",),
        "Additional attribute of an EXR's header; may be repeated.",
        list[str],
        metavar="NAME=VALUE",
        commands=RENDER,
    ),
    "stereo": Flag(
        ("--stereo",),
        "Render both eyes of the camera's stereo pair: two views in one EXR; PNG and JPEG get _left and _right, or %V and %v "
        "filled in.",
        bool,
        commands=RENDER,
    ),
    "report": Flag(("--report",), "Write the render report as JSON.", str, metavar="FILE", shown=False, commands=RENDER),
    "checkpoint": Flag(
        ("--checkpoint",),
        "Write checkpoints, from which --resume continues.",
        str,
        metavar="FILE",
        shown=False,
        commands=RENDER,
    ),
    "checkpoint_every": Flag(
        ("--checkpoint-every",), "Seconds between checkpoints.", float, metavar="S", shown="60", commands=RENDER
    ),
    "resume": Flag(
        ("--resume",),
        "Continue from a checkpoint, and keep writing it unless --checkpoint names another.",
        str,
        metavar="FILE",
        commands=RENDER,
    ),
    "json": Flag(("--json",), "Print JSON lines to stdout.", bool, commands=RENDER),
    "verbose": Flag(("--verbose", "-V"), "Print every diagnostic and prim, and tracebacks of errors.", bool, commands=RENDER),
    "turntable": Flag(
        ("--turntable",), "Render N frames of one orbit around the scene.", int, metavar="N", shown=False, commands=RENDER
    ),
    "fps": Flag(
        ("--fps",), "Also write a movie of a --turntable at this frame rate.", float, metavar="N", shown=False, commands=RENDER
    ),
    "preview": Flag(
        ("--preview",),
        "Quick look, not for measurements: 16 samples per pixel (or --spp), denoised (unless --no-denoise).",
        bool,
        commands=RENDER,
    ),
    "timeout": Flag(
        ("--timeout",),
        "Time limit of each render in seconds.",
        float,
        metavar="S",
        commands=frozenset({"sheet", "thumbnail"}),
    ),
    "list_cameras": Flag(("--list-cameras",), "Print the stage's cameras and exit.", bool, commands=RENDER),
}

# The order of flags that `--help` lists together.
VIEWPOINT = ("camera", "auto_camera", "render_settings", "render_pass")
SIZE = ("resolution", "image_width", "resolution_scale")
FRAMES = ("frames", "frame_count", "frame_inc", "default_time")
LIGHTING = ("default_light", "studio_light", "dome", "dome_rotation", "dome_visible", "ground", "background")
CONTENTS = (
    *("default_wrap", "render_context", "translated_shaders", "purposes"),
    *("variants", "no_payloads", "load", "mask", "session_layer"),
)
TEXTURES = ("texture_memory_bytes", "texture_cache", "texture_cache_bytes")
SURFACES = ("dicing_rate", "complexity", "motion_blur", "shutter", "region", "motion_error")
DIFFUSION = tuple(row.name for row in rows(RenderSettings) if row.name.startswith("diffusion"))
REFUSAL = ("strict", "fail_on", "allow")

Command = TypeVar("Command", bound=Callable[..., None])


def in_order(*names: str) -> Callable[[Command], Command]:
    """Give a command the flags of these names in this order, as far as they are of this command, then its own parameters.

    Other settings whose flags are of this command follow the setting before them.
    """

    def with_order(command: Command) -> Command:
        vars(command)["order"] = names
        return command

    return with_order


def flags_of(of: type = RenderSettings) -> dict[str, Flag]:
    """Return all flags by name, those of settings by the setting's, with the forms that they are read as."""
    return FLAGS | {row.name: row.flag._replace(form=_form_of(row)) for row in rows(of) if row.flag is not None}


def _form_of(row: Row) -> Any:
    if row.flag is not None and row.flag.form is not None:
        return row.flag.form
    return form_of(row)


def default_of(row: Row) -> Any:
    """Return the value of a setting's flag that is not given."""
    form = _form_of(row)
    if form is OnOff:
        return OnOff.ON if row.default else OnOff.OFF
    if form is bool and row.default is not None:
        return False
    return None if form == list[str] or (row.flag and row.flag.form) else row.default


def names_of(command: str, order: Sequence[str], own: Sequence[str], of: type = RenderSettings) -> list[str]:
    """Return the names of a command's flags in the order of its help; `own` are its parameters."""
    flags = flags_of(of)
    names = [name for name in order if name in own or command in flags[name].commands]
    before = -1
    for row in rows(of):
        if row.flag is not None and command in row.flag.commands:
            if row.name not in names:
                names.insert(before + 1, row.name)
            before = names.index(row.name)
    return names + [name for name in own if name not in names]


# Conversions of flags whose values have another form than the setting's.
_CONVERTED: Mapping[str, Callable[[Any], Any]] = {
    "camera": option_values.camera_of,
    "render_settings": option_values.render_settings_of,
    "render_pass": option_values.render_settings_of,
    "resolution_scale": option_values.scale_of,
    "sample_range": option_values.sample_range_of,
    "threads": option_values.threads_of,
    "purposes": option_values.purposes_of,
    "aovs": option_values.aovs_of,
    "fail_on": option_values.codes_of,
    "allow": option_values.codes_of,
    "max_memory_bytes": option_values.bytes_of,
    "texture_memory_bytes": option_values.texture_bytes_of,
    "texture_cache_bytes": option_values.texture_bytes_of,
    "mask": option_values.mask_of,
    "mixes": option_values.mixes_of,
}
# Settings that two flags set.
_TWO_FLAGS: Mapping[str, tuple[Callable[[Any, Any], Any], tuple[str, str]]] = {
    "resolution": (option_values.resolution_of, ("resolution", "image_width")),
    "load": (option_values.load_of, ("no_payloads", "load")),
    "dicing_rate": (option_values.dicing_rate_of, ("dicing_rate", "complexity")),
}


def setting_values(given: Mapping[str, Any], of: type = RenderSettings) -> dict[str, Any]:
    """Return the settings that flags ask for."""
    found = {row.name: _value_of(row, given) for row in rows(of) if row.flag is not None}
    return {name: value for name, value in found.items() if value is not None}


def _value_of(row: Row, given: Mapping[str, Any]) -> Any:
    value = given.get(row.name, default_of(row))
    if row.name in _TWO_FLAGS:
        convert, names = _TWO_FLAGS[row.name]
        return convert(*(value if name == row.name else given.get(name) for name in names))
    if value is None:
        return None
    if row.name in _CONVERTED:
        return _CONVERTED[row.name](value)
    if isinstance(value, OnOff):
        return value is OnOff.ON
    return not value if _turns_off(row) else value


def _turns_off(row: Row) -> bool:
    """Return whether giving the flag turns a setting off that is on by default."""
    return row.default is True and _form_of(row) is bool


def frames_in(given: Mapping[str, Any], scene: str) -> str | None:
    """Return the frame list that flags ask for; None: the stage's default time."""
    names = ("frames", "frame_count", "frame_inc")
    frames, count, increment = (given.get(name) for name in names)
    default_time = given.get("default_time", False)
    return option_values.frames_of(frames, count, increment, default_time, scene, given.get("session_layer"))
