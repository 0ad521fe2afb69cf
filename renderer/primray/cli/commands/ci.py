"""`primray ci`: which stages does a change of a git repository reach, what changes in their pictures, and by which edits?

Exit codes: 0 nothing changed, 1 changed, 3 a layer or a stage can no longer be read, 6 undecided, 2 usage error.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...errors import SettingsError
from .. import option_values
from ..flags import in_order


@in_order()
def ci(
    base: Annotated[
        str | None,
        typer.Argument(
            metavar="[BASE]",
            help="Commit or branch to compare with, from where both sides part.",
            show_default="origin's main branch; with --staged HEAD",
        ),
    ] = None,
    head: Annotated[
        str | None, typer.Option("--head", metavar="REF", help="The side after.", show_default="the working tree")
    ] = None,
    staged: Annotated[bool, typer.Option("--staged", help="Compare what is staged, as before a commit.")] = False,
    stages: Annotated[
        list[str] | None,
        typer.Option(
            "--stage", metavar="GLOB", help="Stages to look at; may be repeated.", show_default="those no other stage uses"
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Write index.html, report.json, comment.md.", show_default=False),
    ] = None,
    link: Annotated[
        str, typer.Option("--link", metavar="URL", help="Address of the page, for the comment.", show_default=False)
    ] = "",
    camera: str | None = None,
    frames: str | None = None,
    image_width: int = 320,
    spp: int = 16,
    tolerance: Annotated[float, typer.Option(metavar="T", help="Smallest relative difference that matters.")] = 0.01,
    most: Annotated[int, typer.Option("--most", metavar="N", help="Most stages to render.")] = 32,
    most_edits: Annotated[
        int, typer.Option("--most-edits", metavar="N", help="Most edits to make alone; more are put together by prim.")
    ] = 64,
    threads: int | None = None,
    max_memory_bytes: str = "16G",
    json: Annotated[bool, typer.Option("--json", help="Print JSON to stdout instead of text.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-V", help="Print tracebacks of errors.")] = False,
) -> None:
    """Compare the pictures of stages before and after a change of a git repository, and say which edits moved which pixels.

    Exit code 0: nothing changed, 1: changed, 3: a layer or stage can no longer be read, 6: undecided, 2: usage error.
    """
    import warnings

    from ...ci.attribution import Asked, judged
    from ...ci.findings import Findings, as_json, lines
    from ...ci.repository import sides
    from ...ci.touched import reach
    from ...diagnostic_messages import RenderWarning
    from ...settings import RenderSettings
    from ..console import print_line

    if staged and head is not None:
        raise SettingsError("what is staged and a commit are two sides after: give one of them", code="usage")
    if min(image_width, spp, most, most_edits) < 1:
        raise SettingsError("width, samples, stages and edits must be above 0", code="usage")
    if link and not link.startswith(("https://", "http://")):
        raise SettingsError("the page's address must begin with https:// or http://", where=link, code="usage")
    times = option_values.time_codes_of(option_values.frames_of(frames, None, None, False, "ci", None)) if frames else ()
    settings = RenderSettings(
        camera=camera,
        resolution=(image_width, 0),
        spp=spp,
        threads=threads,
        max_memory_bytes=option_values.bytes_of(max_memory_bytes),
    )
    asked = Asked(settings, tolerance, most_edits, tuple(time for time in times or () if time is not None))
    with sides(Path.cwd(), base, head, staged=staged) as both, warnings.catch_warnings():
        warnings.simplefilter("ignore", RenderWarning)  # what the side after says anew is in the findings
        found_stages = reach(both, stages or [], most)
        results = tuple(judged(touched, both, asked) for touched in found_stages.stages)
        found = Findings(both, found_stages, results, tolerance)
        if output is not None:
            _write(found, Path(output), link)
        if json:
            print_line({"type": "ci", **as_json(found)})
        else:
            print("\n".join(lines(found)))
    raise typer.Exit(found.exit_code)


def _write(found: object, folder: Path, link: str) -> None:
    from ...ci.changes import COMMENT, PAGE, REPORT
    from ...ci.findings import Findings, as_json, comment
    from ...ci.findings_page import write_page
    from ...images.image import write_text
    from ...images.output_path import make_folder
    from ..console import dumps

    assert isinstance(found, Findings)
    make_folder(folder / PAGE)
    write_page(found, folder / PAGE)
    write_text(folder / REPORT, dumps(as_json(found), indent=2) + "\n")
    write_text(folder / COMMENT, comment(found, link))
