"""The page of benchmarks is what was measured last, and its tables and charts say what the figures say."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from tests.docs.measured import benchmark_tables as tables
from tests.docs.measured import moving_tables

from .benchmarks import CHARTS, PAGE, page
from .charts import WIDTH, Line, chart

SVG = "{http://www.w3.org/2000/svg}"


def test_the_page_and_its_charts_are_fresh():
    made = page()
    assert PAGE.read_text(encoding="utf-8") == made.text(), "docs/benchmarks.md is stale; run `make docs`"
    assert {path.name: path.read_text(encoding="utf-8") for path in CHARTS.iterdir()} == made.charts


def test_every_chart_is_on_the_page():
    text = PAGE.read_text(encoding="utf-8")
    for path in CHARTS.iterdir():
        assert f"(benchmarks/{path.name})" in text


def test_a_chart_has_each_line_with_its_points_in_place():
    falling = Line("one", [(1, 0.1), (10, 0.01)])
    rising = Line("two", [(1, 0.01), (10, 0.1)], [(0.005, 0.02), (0.1, 0.1)])
    root = ElementTree.fromstring(chart("a < b", "seconds", "error", [falling, rising]))
    assert next(root.iter(f"{SVG}text")).text == "a < b"
    first, second = (
        [tuple(float(v) for v in point.split(",")) for point in line.get("points", "").split()]
        for line in root.iter(f"{SVG}polyline")
    )
    assert first[0][0] == second[0][0] < first[1][0]
    assert first[0][1] == second[1][1] < first[1][1]  # up is more
    assert len(list(root.iter(f"{SVG}circle"))) == 4
    assert all(0 <= float(circle.get("cx", -1)) <= WIDTH for circle in root.iter(f"{SVG}circle"))


def curve(renderer, seconds, relmse, first=1.0, peak=100.0):
    """A renderer whose error times seconds is that, at 4, 16 and 64 samples, in two rounds."""
    pictures = [
        {"samples": n, "seconds": seconds * n, "cpu_s": 0.0, "relmse": relmse / n, "mean": 0.0, "peak_mb": peak}
        for n in (4, 16, 64)
    ]
    rounds = [{"first": {"process_s": first, "stages_s": {"load": 0.2}}, "pictures": pictures}] * 2
    reference = {"apart_from_ours": {"mean": 0.0, "blocks": 0.001}}
    return {"renderer": renderer, "scene": "box", "resolution": [100, 100], "rounds": rounds, "reference": reference}


def test_times_to_an_error_and_their_ratio():
    rows = [curve("primray", 0.1, 0.1), curve("other", 0.3, 0.05), {"renderer": "absent", "left_out": "why"}]
    ours, other = tables.curve_table("box", rows).splitlines()[2:]
    assert ours.split(" | ")[5:7] == ["5.00", "1.00"]  # 0.002 is 50 samples away
    assert other.split(" | ")[5:7] == ["7.50", "1.50"]


@pytest.mark.parametrize(
    ("other", "lost"),
    [
        (curve("other", 0.3, 0.1), []),
        (curve("other", 0.12, 0.1), ["to a relMSE of 0.002 ours is 1.20 times as fast as other, 1.3 times is aimed at"]),
        (curve("other", 0.05, 0.1), ["other reaches a relMSE of 0.002 in 2.50 s, ours in 5.00 s"]),
        (curve("other", 0.3, 0.1, first=0.5), ["other takes 0.5 s to a first picture, ours 1"]),
        (curve("other", 0.3, 0.1) | {"firsts": [{"process_s": 0.5}]}, ["other takes 0.5 s to a first picture, ours 1"]),
        (curve("other", 0.3, 0.1, peak=50.0), ["other takes 50 MB of memory, ours 100"]),
    ],
)
def test_it_says_where_another_is_better(other, lost):
    assert list(tables.curves_lost("box", [curve("primray", 0.1, 0.1), other])) == [f"box: {each}" for each in lost]


def test_it_says_where_embree_waits_for_us():
    row = {"scene": "box", "lanes": 8, "embree_share_median": 0.7}
    assert len(list(tables.replay_lost([row, row | {"lanes": 4}, row | {"embree_share_median": 0.76}]))) == 1


def test_it_says_where_moving_rays_are_slower_than_embree():
    row = {"kind": "terrain", "times": 2, "shadow": False, "entry": "recorded", "rate_median": 0.84}
    [sentence] = moving_tables.rates_lost([row, row | {"rate_median": 0.86}, row | {"entry": "packets"}])
    assert "nearest hits at 84% of Embree's own rate (85% aimed at)" in sentence


def stages(power):
    steps = dict.fromkeys(("translate_cpu_s", "textures_cpu_s", "dice_cpu_s", "build_cpu_s"), 0.0)
    return [{"kind": "lights", "count": n, "open_cpu_s": 1e-4 * n**power, **steps} for n in (10, 100, 1000, 10_000)]


def test_it_says_what_grows_too_fast():
    assert list(tables.growth_lost(stages(1.0))) == []
    [sentence] = tables.growth_lost(stages(1.5))
    assert "lights grows by the power 1.50" in sentence


def test_it_says_where_threads_do_not_help_and_what_is_better_left_out():
    rows = [{"scene": "box", "kind": "threads", "count": n, "seconds": s} for n, s in ((1, [2.0, 2.2]), (2, [1.25, 1.3]))]
    [sentence] = tables.pictures_lost(rows)
    assert "1.65 times" in sentence
    assert "cores" not in sentence
    crowded = [row | {"cpu_s": cpu} for row, cpu in zip(rows, ([2.0, 2.2], [2.0, 2.21]), strict=True)]
    assert tables.work_of_threads(crowded) == {2: (pytest.approx(1.65), pytest.approx(1.0023, abs=1e-4))}
    [sentence] = tables.pictures_lost(crowded)
    assert sentence.endswith("with 1.65 cores to themselves")
    assert "1.65, 1.002" in tables.pictures_table(crowded)
    row = {"scene": "box", "name": "a thing", "instead": "none", "error_seconds": 0.9, "range": [0.8, 0.95]}
    assert len(list(tables.ablations_lost([row, row | {"range": [0.8, 1.1]}]))) == 1
