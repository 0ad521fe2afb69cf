"""`primray lidar`: the points that a lidar measures in one frame of a stage."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from .. import option_values
from ..flags import in_order

if TYPE_CHECKING:
    from ...sensor.lidar import LidarScan


@in_order("scene")
def lidar(
    scene: str,
    outputs: Annotated[
        list[str] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Points: .npy, .pcd or .las.", show_default="none"),
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option(
            metavar="PRIM", help="Path or name of the lidar's prim.", show_default="the only one with lidar attributes"
        ),
    ] = None,
    pattern: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|NAME",
            help="Pattern: a .json, a .csv of channels, or a name.",
            show_default="the prim's, else rotating-32",
        ),
    ] = None,
    returns: Annotated[int, typer.Option(metavar="N", help="Returns of a firing that are kept, 1 to 15.")] = 3,
    keep: Annotated[str, typer.Option("--which", metavar="WHICH", help="Which ones: first, strongest or last.")] = "strongest",
    separation: Annotated[
        float, typer.Option(metavar="METRES", help="Surfaces nearer to each other along a beam are one return.")
    ] = 0.1,
    min_intensity: Annotated[
        float, typer.Option(metavar="I", help="Weaker returns are lost; a white surface that faces the sensor has 1.")
    ] = 1e-3,
    weights: Annotated[
        tuple[float, float, float], typer.Option(metavar="R G B", help="Shares of red, green and blue in a beam's reflectance.")
    ] = (1.0, 0.0, 0.0),
    reference_range: Annotated[
        float | None,
        typer.Option(
            metavar="METRES", help="Let intensity fall with the square of the distance, from this one.", show_default="off"
        ),
    ] = None,
    range_noise: Annotated[float, typer.Option(metavar="METRES", help="Standard deviation of ranges.")] = 0.0,
    noise_seed: Annotated[int, typer.Option(metavar="N", help="Which noise.")] = 0,
    axes: Annotated[
        str,
        typer.Option(
            metavar="AXES",
            help="Positions: sensor (as each beam was fired), start (of the frame, the sensor's motion taken out), world.",
        ),
    ] = "sensor",
    taxonomy: Annotated[str, typer.Option(metavar="NAME", help="Taxonomy of the labels.")] = "class",
    frames: str | None = None,
    motion_blur: bool = False,
    label_table: str | None = None,
    variants: list[str] | None = None,
    purposes: str | None = None,
    session_layer: str | None = None,
    threads: int | None = None,
    report: Annotated[
        str | None, typer.Option(metavar="FILE", help="Write parts, labels, pattern and counts as JSON.", show_default=False)
    ] = None,
    verbose: bool = False,
) -> None:
    """Scan a stage by a lidar: points with range, intensity, returns, time and labels, while it spins and everything moves."""
    import warnings

    from ...diagnostic_messages import RenderWarning, print_diagnostics
    from ...images.image import write_text
    from ...images.output_path import check_folder
    from ...sensor.lidar import LidarDetector, check_axes
    from ...sensor.lidar import lidar as scan_of
    from ...sensor.lidar_files import check_output
    from ...settings import RenderSettings
    from ..console import dumps

    check_axes(axes)
    for path in outputs or ():
        check_output(Path(path))
    if len(set(map(Path, outputs or ()))) < len(outputs or ()):
        raise SettingsError("an output is named twice", code="output-name")
    if report is not None:
        check_folder(Path(report))
    detector = LidarDetector(
        returns=returns,
        keep=keep,
        separation_m=separation,
        min_intensity=min_intensity,
        weights=weights,
        reference_range_m=reference_range,
        range_noise_m=range_noise,
        seed=noise_seed,
    )
    values: dict[str, Any] = {
        "time_code": option_values.one_frame_of(frames, "lidar"),
        "motion_blur": not motion_blur,
        "label_table": label_table,
        "variants": tuple(variants) if variants else None,
        "purposes": None if purposes is None else option_values.purposes_of(purposes),
        "session_layer": session_layer,
        "threads": None if threads is None else option_values.threads_of(threads),
    }
    settings = RenderSettings(**{name: value for name, value in values.items() if value is not None})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RenderWarning)  # they are printed below
        scan = scan_of(scene, sensor, pattern, settings, detector=detector, taxonomy=taxonomy)
    print_diagnostics([diagnostic.as_json() for diagnostic in scan.diagnostics], verbose=verbose)
    for path in outputs or ():
        scan.save(path, axes)
    if report is not None:
        write_text(Path(report), dumps(scan.as_json(), indent=2) + "\n")
    print("\n".join(_lines(scan)))


def _lines(scan: LidarScan) -> list[str]:
    near, far = scan.pattern.range_m
    lines = [
        f"{scan.firings:,} firings in {1000 * scan.pattern.duration_s:.4g} ms, {len(scan.points):,} points",
        f"{scan.misses:,} firings ({scan.misses / scan.firings:.1%}) without a return from {near:g} to {far:g} m",
    ]
    if len(scan.points):
        ranges, intensity = scan.points["range"], scan.points["intensity"]
        lines.append(
            f"ranges {ranges.min():.4g} to {ranges.max():.4g} m, intensities {intensity.min():.3g} to {intensity.max():.3g}"
        )
        several = int((scan.points["return_number"] == 2).sum())
        if several:
            lines.append(f"{several:,} firings with several returns")
    if scan.classes:
        labelled = float((scan.points["object_id"] > 0).mean())
        lines.append(f"{labelled:.1%} of the points are labelled: {', '.join(scan.classes.values())}")
    return lines
