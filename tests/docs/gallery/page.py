"""docs/gallery.md and README.md's thumbnails, from what is recorded of the pictures. `python -m tests.docs.gallery.page`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .pictures import records
from .scenes import ROOT, SHOWN, Shown

PAGE, README = ROOT / "docs/gallery.md", ROOT / "README.md"
BEGIN = "<!-- the gallery, by `make docs`: begin -->"
END = "<!-- the gallery: end -->"
HEAD = """# Gallery

Eleven scenes of the project's own. Each stage is made by the script beside it; the command under a picture renders it again,
to the same bits. Errors are relative squared errors ([what that is](error.md)) of the very picture, with their 95 %
intervals; seconds are of one core. A picture is denoised only where it says so; its error is then measured too
([how](denoising.md)).
"""


MORE = """## More

Stages of [scenes/features](../scenes/features/README.md), one for each thing that a stage may ask for:

![Ten features](features.png)

`scenes/showcase/meadow`: 14,000 tufts of grass, glass, gold and a sky, 636 samples a pixel.

![A meadow](showcase.png)

[Labels](labels.md), [mattes](cryptomatte.md), [light paths](light-paths.md), and [what denoising does](denoising.md).
"""


def number(value: float) -> str:
    return f"{value:.2g}" if value >= 0.0001 else f"{value:.1e}".replace("e-0", "e-")


def error(measured: Mapping[str, Any]) -> str:
    """As of a report: `estimate` and `ci95`."""
    low, high = measured["ci95"]
    return f"{number(measured['estimate'])} ({number(low)} to {number(high)})"


def facts(shown: Shown, kept: Mapping[str, Any]) -> str:
    low, high, mean = kept["samples_per_pixel"]
    samples = f"{mean} samples a pixel" if low == high else f"{mean} samples a pixel ({low} to {high})"
    seconds = f"{kept['cpu_s']:,.0f} s of one core"
    if shown.denoised:
        denoised, of_samples = kept["denoised_relmse"], f"of the samples themselves {error(kept['relmse'])}"
        if denoised["ci95"][1] > 0:
            of_both = f"Denoised: relMSE {error(denoised)}; {of_samples}"
        else:  # the estimate is negative, which becomes 0
            of_both = f"Denoised: its error is lost in the tails of the noise; relMSE {of_samples}"
        return f"{of_both}; {samples}, {seconds}."
    return f"relMSE {error(kept['relmse'])}; {samples}, {seconds}. Not denoised."


def section(shown: Shown, kept: Mapping[str, Any]) -> str:
    stage = shown.path.relative_to(ROOT)
    sources = f"[{stage}](../{stage})"
    if (shown.path.parent / "generate.py").exists():
        sources += f", made by [generate.py](../{stage.parent}/generate.py)"
    pictures = f"![{shown.title}](gallery/{shown.name}.jpg)"
    if shown.name == "cornell":
        pictures += (
            "\n\n![The standard error of each pixel, from a thousandth of its value, black, to all of it, white]"
            "(gallery/cornell-error.jpg)"
        )
    return f"## {shown.title}\n\n{pictures}\n\n{shown.text}\n\n{facts(shown, kept)} {sources}:\n\n    {shown.command}\n"


def page(shown: Sequence[Shown], kept: Mapping[str, Any]) -> str:
    return "\n".join([HEAD, *(section(one, kept[one.name]) for one in shown), MORE])


def thumbnails(shown: Sequence[Shown]) -> str:
    return "\n".join(
        f'<a href="docs/gallery.md"><img src="docs/gallery/{one.name}-small.jpg" width="16%" alt="{one.title}"></a>'
        for one in shown
    )


def with_thumbnails(readme: str, shown: Sequence[Shown]) -> str:
    before, _, rest = readme.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{thumbnails(shown)}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(SHOWN, records()), encoding="utf-8")
    README.write_text(with_thumbnails(README.read_text(encoding="utf-8"), SHOWN), encoding="utf-8")
