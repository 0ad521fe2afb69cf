"""Flags of usdrecord and husk without a counterpart in primray, with the alternative; and flags that primray can ignore.

docs/from-usdrecord-and-husk.md lists every flag of both; tests/docs/flags keeps page, tables and parser consistent.
"""

from __future__ import annotations

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
