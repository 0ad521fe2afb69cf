"""Every flag of usdrecord (OpenUSD 25) and husk (Houdini 19.5 to 22), and docs/from-usdrecord-and-husk.md's tables of them.

`python -m tests.docs.flags.foreign` rewrites the tables. What is refused, and with which sentence, is primray's own table.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from primray.cli.foreign_command_lines import DONE_ANYWAY, REFUSED
from primray.cli.shots import FPS_ALONE

PAGE = Path(__file__).resolve().parents[3] / "docs" / "from-usdrecord-and-husk.md"


@dataclass(frozen=True)
class Understood:
    """A flag in its spellings, values that it takes in a test, and what it does where that is not quite the same."""

    spellings: str
    values: str = ""
    note: str = "the same"


@dataclass(frozen=True)
class Refused:
    """A spelling that means something else here, with a value as the other tool takes it, and what the refusal says."""

    spellings: str
    values: str
    note: str


Row = Understood | Refused | str  # a text: spellings that primray's table refuses, or does anyway

USDRECORD: list[Row] = [
    Understood("--help -h"),
    Understood("--mask", "/World/a,/World/b"),
    Understood(
        "--purposes", "render,proxy", "`default` is always among them; without the flag, the stage's (usdrecord: `proxy`)"
    ),
    Understood("--sessionLayer", "over.usda", "a layer over the stage's own session layer; also `--session-layer`"),
    "--disableGpu",
    "--disableDrawMode",
    Understood(
        "--disableCameraLight",
        "",
        "also `--studio-light off`, `--no-default-light`; here only stages that are dark without it get a studio light",
    ),
    "--resolver",
    Understood("--camera -cam", "/World/cam"),
    Understood(
        "--defaultTime -d", "", "what is done without frames anyway; usdrecord begins at the stage's start: `--frames` that"
    ),
    Understood("--frames -f", "101:109x2"),
    Understood(
        "--complexity", "high", "`--dicing-rate` of 16, 8, 4 (the default) and 2 pixels; surfaces are smooth at any of them"
    ),
    Refused("-c", "high", "`-c` is the camera, as husk's; `--complexity` has no short form"),
    Understood(
        "--colorCorrectionMode -color",
        "sRGB",
        "of PNG and JPEG: the views Raw (`disabled`), Un-tone-mapped (`sRGB`) and the display's default (`openColorIO`)",
    ),
    "--renderer",
    Refused("-r", "Storm", "`-r` is `--res`, as husk's; " + REFUSED["--renderer"]),
    Understood("--imageWidth -w", "640"),
    "--enableDomeLightVisibility",
    Understood("--renderPassPrimPath -rp", "/Render/pass"),
    Understood("--renderSettingsPrimPath -rs", "/Render/settings"),
    "--traceToFile",
    "--traceFormat",
    "--memstats",
]

HUSK: list[Row] = [
    Understood("--help -h"),
    "--version -v",
    "--properties",
    "--property-definition --property-definitions",
    "--property-definition-file --property-definitions-file",
    "--procedurals",
    "--filters",
    "--engine",
    Understood("--pixel-samples -p", "16", "also `--spp`; 64 without it (husk: 128)"),
    "--bucket-size",
    "--bucket-order",
    "--image-mode",
    "--progressive-passes",
    "--autotile",
    "--disable-lighting",
    "--ao-samples",
    "--ao-distance",
    "--headlight",
    "--autoheadlight",
    Understood("--lock-random", "7", "also `--seed`; without it 0 in every frame"),
    "--dicingcamera",
    "--optimize-offline",
    "--convergence-mode",
    "--karma-percent-of-samples",
    "--baking-info",
    "--oiio-max-memory-percent",
    "--usd-input",
    "--resolver-context",
    "--resolver-context-string",
    "--variant-fallback",
    "--list-settings",
    Understood("--list-cameras", "", "a path a line"),
    "--list-renderers",
    Understood("--purpose", "geometry,render", "`geometry` is `default`, and always among them"),
    Understood("--complexity", "veryhigh", "as in usdrecord's table; numbers are `--dicing-rate PIXELS`"),
    Understood("--mask", "/World/a"),
    "--disable-scene-materials",
    "--disable-scene-lights",
    Understood("--disable-motionblur", "", "also `--no-motion-blur`"),
    "--disable-delegate-products",
    "--disable-dummy-raster-product",
    Understood("--settings -s", "rendersettings", "a path, or a name in /Render"),
    "--pass",
    "--prerender-script",
    "--preframe-script",
    "--postframe-script",
    "--postrender-script",
    "--allowed-procedurals",
    "--capture-procedurals",
    "--procedurals-capture-directory",
    "--usd-trace",
    "--usd-chrome-file",
    Understood("--camera -c", "/World/cam"),
    Understood("--output -o", "shot.$F4.exr", "repeated, not by commas; of several products the flag is `--output-dir`"),
    Understood("--res -r", "1280 720"),
    Understood("--res-scale -S", "50"),
    "--pixel-aspect",
    Understood("--make-output-path", "", "the report's folder, too"),
    "--disable-disk-check",
    "--extra-metadata",
    "--ocio",
    "--exrmode",
    "--autocrop",
    "--slap-comp",
    "--no-mplay",
    "--mplay-monitor",
    "--mplay-scale",
    "--mplay-update",
    "--mplay-session",
    "--mplay-bgimage",
    "--mplay-remotehost",
    "--mplay-gamma",
    "--mplay-lut",
    Understood("--frame -f", "1", "also lists, as `--frames`"),
    Understood("--frame-count -n", "10"),
    Understood("--frame-inc -i", "2"),
    "--frame-list",
    Refused("--fps", "24", FPS_ALONE),
    "--renderer -R",
    "--delegate-options",
    Understood("--threads -j", "-1", "0: all cores, -1: all but one"),
    "--fast-exit",
    "--restart-delegate",
    Understood("--snapshot", "30", "at an interval in seconds, to the output's own file (husk: beside it, as `_part`)"),
    "--snapshot-path",
    "--snapshot-suffix",
    "--snapshot-save-mode",
    "--tile-count",
    "--tile-index",
    "--tile-suffix",
    "--timelimit",
    "--timelimit-image",
    "--timelimit-nosave-partial",
    "--stdout",
    "--stderr",
    "--append-stdout",
    "--append-stderr",
    "--windows-console",
    Understood("--verbose -V", "5ae", "from 3 on every diagnostic and prim; letters change nothing, `--json` has the progress"),
    "--check-licenses",
    "--skip-licenses",
    "--list-license-checks",
    "--skip-license-modes",
    "--check-license-modes",
    "--license-release-delay",
    "--license-max-seat-hold",
    "--apprentice",
    "--indie",
    "--core",
    "--pdg",
]
TABLES = {"usdrecord": USDRECORD, "husk": HUSK}


def spellings(row: Row) -> list[str]:
    return (row if isinstance(row, str) else row.spellings).split()


def _line(row: Row) -> str:
    flags = ", ".join(f"`{flag}`" for flag in spellings(row))
    if isinstance(row, Understood):
        return f"| {flags} | understood | {row.note} |"
    if isinstance(row, Refused):
        return f"| {flags} | refused | {row.note} |"
    first = spellings(row)[0]
    if first in DONE_ANYWAY:
        return f"| {flags} | done anyway | {DONE_ANYWAY[first][1]} |"
    return f"| {flags} | refused | {REFUSED[first]} |"


def with_tables(page: str) -> str:
    """The page with every table between its marks made new."""
    for tool, rows in TABLES.items():
        begin, end = marks(tool)
        before, _, rest = page.partition(begin)
        _, _, after = rest.partition(end)
        table = "\n".join(["| flag | is | here |", "|---|---|---|", *map(_line, rows)])
        page = f"{before}{begin}\n{table}\n{end}{after}"
    return page


def marks(tool: str) -> tuple[str, str]:
    return f"<!-- {tool}'s flags, by `make docs`: begin -->", f"<!-- {tool}'s flags: end -->"


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
