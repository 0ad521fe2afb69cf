"""Command lines in the style of usdrecord and husk, converted to primray's own or refused with advice.

Only flags that primray does not have, sizes like 320x200, and husk's `--verbose LEVEL` are converted; the rest is unchanged.
docs/from-usdrecord-and-husk.md lists every flag of both; tests/docs/flags keeps page, tables and parser consistent.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from ..errors import SettingsError

COMMANDS = ("render", "estimate", "inspect", "submit")  # commands with a counterpart in usdrecord or husk

_LEVEL = re.compile(r"[aAcCeEpPtT]*(\d)[aAcCeEpPtT]*")  # husk's level: a digit among letters for the line format
SIZES = ("--res", "--resolution", "-r")
_SIZE = re.compile(r"(\d+)[x,X\u00d7](\d+)")
_STARTS_NUMBER = re.compile(r"-?\d")
QUIET_LEVEL = 2  # husk's default; higher levels are primray's --verbose


def translate_foreign_flags(arguments: Sequence[str]) -> list[str]:
    """Return the command line in primray's own style. SettingsError, with advice, for a flag that is refused."""
    arguments = [*_with_sizes_apart(iter(arguments))]
    if not arguments or arguments[0] not in COMMANDS:
        return arguments
    return [arguments[0], *_words(iter(arguments[1:]))]


def _with_sizes_apart(words: Iterator[str]) -> Iterator[str]:
    """Yield the words, splitting sizes like 320x200 into two; SettingsError for a size of one number."""
    for word in words:
        flag, joined, size = word.partition("=") if word.startswith("--") else (word, "", "")
        if word == "--" or flag not in SIZES:
            yield word
            if word == "--":
                yield from words
            continue
        first = size if joined else next(words, None)
        yield flag
        both = None if first is None else _SIZE.fullmatch(first)
        if both is not None:
            yield from both.groups()
            continue
        second = next(words, None)
        if first is not None and first[:1].isdigit() and not _STARTS_NUMBER.match(second or ""):
            sentence = f"expected width and height in pixels, such as 320 200 or 320x200 (0: from the camera), not {first}"
            raise SettingsError(sentence, where=flag, code="resolution")
        yield from (word for word in (first, second) if word is not None)


def _words(words: Iterator[str]) -> Iterator[str]:
    """Yield the words without ignored flags. `words` is consumed lazily, since a flag may take its value from the next word."""
    pending: list[str] = []
    while (word := pending.pop() if pending else next(words, None)) is not None:
        if word == "--":
            yield word
            yield from words
            return
        flag, joined, value = word.partition("=") if word.startswith("--") else (word, "", "")
        _refuse(flag)
        if flag in DONE_ANYWAY:
            if DONE_ANYWAY[flag][0] and not joined:
                next(words, None)
        elif flag == "-r":
            yield word
            pending += _size(words)
        elif flag in ("--verbose", "-V"):
            following = value if joined else next(words, None)
            level = _LEVEL.fullmatch(following or "")
            if level is None or int(level[1]) > QUIET_LEVEL:
                yield flag
            if level is None and following is not None:
                if joined:
                    raise _no_level(value)
                pending.append(following)
        elif word.startswith("-V") and _LEVEL.fullmatch(word[2:]):
            pending += ["--verbose=" + word[2:]]
        else:
            yield word


def _refuse(flag: str) -> None:
    known = flag if flag in REFUSED else flag[:2] if flag[:1] == "-" != flag[1:2] else ""  # -RKarma is -R Karma
    if known in REFUSED:
        raise SettingsError(f"{known}: {REFUSED[known]}", code="foreign-flag")


def _size(words: Iterator[str]) -> list[str]:
    """Return the word after -r; SettingsError for usdrecord's -r, which names a renderer."""
    word = next(words, None)
    if word is not None and word[:1].isalpha():
        raise SettingsError(f"-r means --res W H; for usdrecord's --renderer: {REFUSED['--renderer']}", code="foreign-flag")
    return [] if word is None else [word]


def _no_level(text: str) -> SettingsError:
    return SettingsError(f"--verbose expects a level such as 3, not {text!r}", code="verbose")


_STREAMS = "use the shell: `> FILE`, `>> FILE`, `2> FILE`, or `--report FILE` for the facts of a render"
_SESSION = "author it in a layer and pass that with --session-layer FILE"
_NO_LICENSE = "primray needs no license: remove this flag"
_NO_PLUGIN = "primray is a renderer of its own, not a Hydra delegate: remove this flag"
_NO_VIEWER = "primray does not use mplay; -o tev:// shows the render in a running tev, and `primray view` in a browser"
_NO_SCRIPT = "renders run no scripts; change the stage beforehand, or with --session-layer FILE"
_BY_SAMPLES = (
    "pictures are split by samples: use --sample-range A:B, then `primray merge`; --region LEFT BOTTOM RIGHT TOP "
    "renders a part of the picture"
)
_NO_BUCKETS = "all pixels refine together, without buckets or modes: remove this flag"
_NO_PROCEDURALS = "Houdini's procedurals are not supported; bake them into the stage"
_NO_TRACE = "--report FILE has the seconds and the memory of every stage of a render"
_SNAPSHOT = "--snapshot S writes the unfinished picture to the output file, which the finished picture replaces"
_HEADLIGHT = "a stage without lights gets a studio light; --studio-light off leaves it dark"
_LIGHTS = f"to remove lights, deactivate them: {_SESSION}"
_LIST_INSPECT = "`primray inspect` shows a stage's contents; --render-settings lists the available prims if the name is unknown"

# Refused flags, with the alternative.
REFUSED: dict[str, str] = {
    # usdrecord
    "--disableDrawMode": f"draw modes are always applied; to disable one, set model:drawMode to default: {_SESSION}",
    "--resolver": "assets are always resolved in the root layer's context, like `--resolver root`: remove this flag",
    "--enableDomeLightVisibility": "the camera sees domes unless the stage hides them: remove this flag",
    "--traceToFile": _NO_TRACE,
    "--traceFormat": _NO_TRACE,
    "--memstats": _NO_TRACE,
    "--renderer": _NO_PLUGIN,
    # husk: information
    "--version": "`primray --version` prints versions",
    "-v": "`primray --version` prints versions",
    "--list-settings": _LIST_INSPECT,
    "--list-renderers": _NO_PLUGIN,
    "--properties": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definition": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definitions": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definition-file": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definitions-file": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--procedurals": _NO_PROCEDURALS,
    "--filters": "--filter chooses the pixel filter; --denoise adds a denoised picture",
    "--baking-info": "textures are not baked: remove this flag",
    # husk: Karma
    "--engine": _NO_PLUGIN,
    "--bucket-size": _NO_BUCKETS,
    "--bucket-order": _NO_BUCKETS,
    "--image-mode": _NO_BUCKETS,
    "--progressive-passes": _NO_BUCKETS,
    "--autotile": _NO_BUCKETS,
    "--disable-lighting": _LIGHTS,
    "--ao-samples": "there is no ambient occlusion shading; a white dome light looks similar",
    "--ao-distance": "there is no ambient occlusion shading; a white dome light looks similar",
    "--headlight": _HEADLIGHT,
    "--autoheadlight": _HEADLIGHT,
    "--dicingcamera": "surfaces are diced for the rendering camera; --dicing-rate sets how finely",
    "--optimize-offline": "it has no effect in husk either: remove this flag",
    "--convergence-mode": "--target-error E stops at an error, and --adaptive takes more samples where the error is large",
    "--karma-percent-of-samples": "--spp N sets the samples per pixel",
    "--oiio-max-memory-percent": "--max-memory SIZE limits the whole render",
    # husk: USD
    "--usd-input": "name the stage without a flag: primray render STAGE",
    "--resolver-context": "assets are resolved in the root layer's context; configure the resolver by its environment",
    "--resolver-context-string": "assets are resolved in the root layer's context; configure the resolver by its environment",
    "--variant-fallback": "--variant PRIM:SET=NAME chooses a variant of a prim",
    "--disable-scene-materials": f"to remove materials, block their bindings: {_SESSION}",
    "--disable-scene-lights": _LIGHTS,
    "--disable-dummy-raster-product": "a stage without products renders one picture: remove this flag",
    "--pass": "--render-pass PRIM renders a pass; --render-settings PRIM chooses RenderSettings",
    "--prerender-script": _NO_SCRIPT,
    "--preframe-script": _NO_SCRIPT,
    "--postframe-script": _NO_SCRIPT,
    "--postrender-script": _NO_SCRIPT,
    "--allowed-procedurals": _NO_PROCEDURALS,
    "--capture-procedurals": _NO_PROCEDURALS,
    "--procedurals-capture-directory": _NO_PROCEDURALS,
    "--usd-trace": _NO_TRACE,
    "--usd-chrome-file": _NO_TRACE,
    # husk: output
    "--pixel-aspect": f"set pixelAspectRatio of the RenderSettings: {_SESSION}",
    "--extra-metadata": "--metadata NAME=VALUE adds an attribute to an EXR's header, and may be repeated",
    "--ocio": "PNG and JPEG always use OpenColorIO; --view, --display and --look choose the transform",
    "--slap-comp": "use a compositing application, with the parts that --aov writes",
    "--autocrop": "pictures are not cropped automatically; --region LEFT BOTTOM RIGHT TOP renders a part of the frame",
    "--mplay-monitor": _NO_VIEWER,
    "--mplay-scale": _NO_VIEWER,
    "--mplay-update": _NO_VIEWER,
    "--mplay-session": _NO_VIEWER,
    "--mplay-bgimage": _NO_VIEWER,
    "--mplay-remotehost": _NO_VIEWER,
    "--mplay-gamma": _NO_VIEWER,
    "--mplay-lut": _NO_VIEWER,
    # husk: frames
    "--frame-list": "--frames accepts lists separated by commas: --frames 1,5,9",
    # husk: rendering
    "-R": _NO_PLUGIN,
    "--delegate-options": _NO_PLUGIN,
    "--restart-delegate": "every frame is built from scratch: remove this flag",
    "--snapshot-path": _SNAPSHOT,
    "--snapshot-suffix": _SNAPSHOT,
    "--snapshot-save-mode": _SNAPSHOT,
    "--tile-count": _BY_SAMPLES,
    "--tile-index": _BY_SAMPLES,
    "--tile-suffix": _BY_SAMPLES,
    "--timelimit": "--time-limit S limits the sampling of each frame; there is no limit for the whole sequence",
    "--timelimit-image": "--time-limit S limits the sampling of each frame",
    "--timelimit-nosave-partial": "a picture stopped by a limit is saved; exit code 5: --target-error was not reached",
    "--stdout": _STREAMS,
    "--stderr": _STREAMS,
    "--append-stdout": _STREAMS,
    "--append-stderr": _STREAMS,
    "--windows-console": _STREAMS,
    # husk: licenses
    "--check-licenses": _NO_LICENSE,
    "--skip-licenses": _NO_LICENSE,
    "--list-license-checks": _NO_LICENSE,
    "--skip-license-modes": _NO_LICENSE,
    "--check-license-modes": _NO_LICENSE,
    "--license-release-delay": _NO_LICENSE,
    "--license-max-seat-hold": _NO_LICENSE,
    "--apprentice": _NO_LICENSE,
    "--indie": _NO_LICENSE,
    "--core": _NO_LICENSE,
    "--pdg": _NO_LICENSE,
}

# Ignored flags, with their number of values and the reason.
DONE_ANYWAY: dict[str, tuple[int, str]] = {
    "--disableGpu": (0, "no GPU is used"),
    "--no-mplay": (0, "there is no mplay"),
    "--disable-delegate-products": (0, "all products are pictures"),
    "--disable-disk-check": (0, "free disk space is not checked"),
    "--fast-exit": (1, "a render exits as soon as its files are written"),
    "--exrmode": (1, "there is only one way to write an EXR"),
}
