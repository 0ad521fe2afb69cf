"""Photometric files of all editions and types, written here, and what becomes of broken ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.statistics.lights.shaping import intensity

from primray.textures.ies import IesError, IesFile, parse_ies

V3 = "0 45 90"


def text(
    *,
    header: str = "IESNA:LM-63-2002\n[TEST] none\n[MANUFAC] nobody",
    tilt: str = "TILT=NONE",
    multiplier: str = "1",
    kind: int = 1,
    ballast: str = "1 1 50",
    vertical: str = V3,
    horizontal: str = "0",
    candela: str = "100 50 0",
) -> str:
    counts = f"{len(vertical.split())} {len(horizontal.split())}"
    numbers = f"1 1000 {multiplier} {counts} {kind} 2 0 0 0\n{ballast}\n{vertical}\n{horizontal}\n{candela}\n"
    return "\n".join(line for line in (header, tilt, numbers) if line)


def parse(**changes: object) -> IesFile:
    return parse_ies(text(**changes).encode("latin-1"))  # type: ignore[arg-type]


def at(file: IesFile, theta_deg: float, phi_deg: float) -> float:
    """In the profile's frame: theta from nadir, phi counterclockwise seen from above."""
    return float(intensity(file.profile, np.radians([theta_deg]), np.radians([phi_deg]))[0])


HEADERS = (
    "",
    "a lamp\nof 1986, without keywords",
    "IESNA91\n[TEST] x",
    "IESNA:LM-63-1995\n[TEST] x\n[MORE] y",
    "IESNA:LM-63-2002\n[TEST] x",
    "IES:LM-63-2019\n[TEST] x",
)


@pytest.mark.parametrize("header", HEADERS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_editions(header: str, end: str) -> None:
    found = parse_ies(text(header=header).replace("\n", end).encode("latin-1"))
    assert found.notes == ()
    assert found.profile.candela.tolist() == [[100, 50, 0]]
    assert found.profile.vertical_deg.tolist() == [0, 45, 90]
    assert found.profile.horizontal_deg.tolist() == [0]


def test_multipliers() -> None:
    """Candela multiplier, ballast factor and ballast-lamp factor; in 2019 the last is the file's generation type."""
    assert parse(multiplier="2.5", ballast="0.5 0.8 70").profile.candela[0, 0] == pytest.approx(100)
    late = parse(header="IES:LM-63-2019", multiplier="2.5", ballast="0.5 1.10000 70")
    assert late.profile.candela[0, 0] == pytest.approx(125)


def test_tilt() -> None:
    included = parse(tilt="TILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.8")
    assert included.profile.candela[0, 0] == 100
    assert included.notes == ()
    other = parse(tilt="TILT=lamp.tlt")
    assert other.profile.candela[0, 0] == 100
    assert "lamp.tlt" in other.notes[0]


def test_separators_and_what_follows() -> None:
    found = parse(vertical="0 45\n90", candela="100,50,\n0 \x1a")
    assert found.profile.candela.tolist() == [[100, 50, 0]]
    assert found.notes == ()
    assert "2 values" in parse(candela="100 50 0 7 8").notes[0]


def test_symmetries_of_type_c() -> None:
    quadrants = parse(horizontal="0 90", candela="10 20 30\n40 50 60")
    for phi in (0, 180, 360):
        assert at(quadrants, 45, phi) == pytest.approx(20)
    for phi in (90, 270):
        assert at(quadrants, 45, phi) == pytest.approx(50)
    assert at(quadrants, 45, 135) == pytest.approx(35)
    halves = parse(horizontal="0 90 180", candela="1 2 3\n4 5 6\n7 8 9")
    assert [at(halves, 45, phi) for phi in (0, 90, 180, 270, 315)] == pytest.approx([2, 5, 8, 5, 3.5])
    full = parse(horizontal="0 90 180 270 360", candela="1 2 3\n4 5 6\n7 8 9\n3 4 5\n1 2 3")
    assert [at(full, 45, phi) for phi in (0, 90, 180, 270, 315)] == pytest.approx([2, 5, 8, 4, 3])
    other = parse(horizontal="90 180 270", candela="1 2 3\n4 5 6\n7 8 9")  # LM-63-1995
    assert [at(other, 45, phi) for phi in (90, 180, 270, 0, 45, 315)] == pytest.approx([2, 5, 8, 5, 3.5, 6.5])
    assert other.profile.horizontal_deg[[0, -1]].tolist() == [0, 360]


def test_planes_that_do_not_close() -> None:
    open_end = parse(horizontal="0 90 180 270", candela="1 2 3\n4 5 6\n7 8 9\n3 4 5")
    assert [at(open_end, 45, phi) for phi in (0, 270, 315)] == pytest.approx([2, 4, 3])
    assert open_end.notes == ()
    partial = parse(horizontal="0 90 200", candela="1 2 3\n4 5 6\n7 8 9")
    assert "0 to 200 degrees only" in partial.notes[0]
    assert [at(partial, 45, phi) for phi in (0, 199.9, 201, 359)] == pytest.approx([2, 8, 0, 0], abs=0.01)


def test_outside_the_vertical_angles_it_is_dark() -> None:
    down, up = parse(candela="100 50 40"), parse(vertical="90 120 180", candela="10 20 30")
    assert [at(down, t, 12) for t in (0, 89.9, 90.1, 180)] == pytest.approx([100, 40, 0, 0], abs=0.1)
    assert [at(up, t, 12) for t in (0, 89.9, 120, 179.99)] == pytest.approx([0, 0, 20, 30], abs=0.1)


def test_type_a_is_clockwise_about_the_vertical() -> None:
    """Photometric horizontal (0, 0) at theta 90, phi 0; nadir at -90; nothing behind."""
    found = parse(kind=3, vertical="-90 0 90", horizontal="-90 0 90", candela="1 10 2\n1 20 2\n1 40 2")
    assert at(found, 0, 0) == pytest.approx(1)
    assert [at(found, 90, phi) for phi in (0, 45, 89.99, 315, 270.01, 180, 100)] == pytest.approx(
        [20, 15, 10, 30, 40, 0, 0], abs=0.01
    )
    mirrored = parse(kind=3, vertical="-90 0 90", horizontal="0 90", candela="1 20 2\n1 40 2")
    assert [at(mirrored, 90, phi) for phi in (0, 45, 315, 180)] == pytest.approx([20, 30, 30, 0])
    lower = parse(kind=3, vertical="-90 -45 0", horizontal="0 90", candela="1 20 2\n1 40 2")
    assert [at(lower, t, 0) for t in (45, 91)] == pytest.approx([20, 0])


def test_type_b_turns_about_a_horizontal_axis() -> None:
    """(0, 0) is nadir; (0, 90) horizontal at phi 0; horizontal angles lean clockwise seen from above, to phi 270."""
    found = parse(kind=2, vertical="-90 0 90", horizontal="-90 0 90", candela="5 5 5\n10 20 30\n7 7 7")
    assert found.profile.horizontal_pole
    assert at(found, 0, 0) == pytest.approx(20)
    assert at(found, 89.999, 0) == pytest.approx(30, abs=0.01)
    assert at(found, 89.999, 180) == pytest.approx(10, abs=0.01)
    assert at(found, 45, 270) == pytest.approx(13.5)
    assert at(found, 45, 90) == pytest.approx(12.5)
    assert at(found, 100, 0) == 0
    quadrant = parse(kind=2, vertical="0 90", horizontal="0 90", candela="20 30\n7 7")
    assert at(quadrant, 45, 180) == at(quadrant, 45, 0) == pytest.approx(25)
    assert at(quadrant, 45, 90) == at(quadrant, 45, 270) == pytest.approx(13.5)


def test_power() -> None:
    """A uniform profile's power is its intensity, but for the patches' middles; of a hemisphere, also."""
    angles = " ".join(str(a) for a in range(0, 181, 5))
    whole = parse(vertical=angles, candela=" ".join(["7"] * 37))
    assert whole.profile.power == pytest.approx(7, rel=1e-3)
    half = parse(vertical=" ".join(str(a) for a in range(0, 91, 5)), candela=" ".join(["7"] * 19))
    assert half.profile.power == pytest.approx(7, rel=1e-3)
    one = parse()  # two patches: (75 sin 22.5 + 25 sin 67.5) pi/4 2 pi / 2 pi
    assert one.profile.power == pytest.approx((75 * math.sin(math.pi / 8) + 25 * math.sin(3 * math.pi / 8)) * math.pi / 4)
    quadrants = parse(horizontal="0 90", candela="100 50 0\n100 50 0")
    assert quadrants.profile.power == pytest.approx(one.profile.power)


BROKEN = {
    "no TILT": ("hello\nworld\n", "no line begins with TILT="),
    "empty": ("", "no line begins with TILT="),
    "nothing after TILT": ("TILT=NONE\n", "ends before the number of lamps"),
    "cut short": (text(candela="100 50"), "ends before intensity 3 of 3"),
    "words": (text(candela="100 x 0"), "line 9: 'x' is not a number (intensity 2 of 3)"),
    "not finite": (text(candela="100 nan 0"), "'nan' is not a number"),
    "infinite": (text(candela="100 1e999 0"), "'1e999' is not a number"),
    "too bright": (text(candela="100 1e30 0"), "candela, more than"),
    "angles descend": (text(vertical="0 90 45"), "line 7: vertical angles do not ascend (45 after 90)"),
    "angles repeat": (text(horizontal="0 0", candela="1 2 3 4 5 6"), "line 8: horizontal angles do not ascend"),
    "angle outside": (text(vertical="0 90 190"), "vertical angle 190 is outside [0, 180]"),
    "type": (text(kind=4), "line 5: the photometric type is 4"),
    "one vertical angle": (text(vertical="0", candela="1"), "the number of vertical angles is 1"),
    "half an angle": (text().replace("3 1 1 2", "2.5 1 1 2"), "2.5, not a whole number"),
    "many angles": (text().replace("3 1 1 2", "1000000000 1 1 2"), "not a whole number from 2 to 4096"),
    "many intensities": (text().replace("3 1 1 2", "4000 4000 1 2"), "intensities are more than"),
    "negative count": (text().replace("3 1 1 2", "-3 1 1 2"), "-3, not a whole number"),
    "many tilt angles": (text(tilt="TILT=INCLUDE\n1\n99999999"), "the number of tilt angles is 1e+08"),
    "type B, one plane": (text(kind=2), "more than one horizontal angle"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_refused_with_their_line(name: str) -> None:
    content, expected = BROKEN[name]
    with pytest.raises(IesError) as error:
        parse_ies(content.encode("latin-1"))
    assert expected in str(error.value)


def test_arbitrary_bytes_are_refused() -> None:
    rng = np.random.default_rng(1)
    for n in (1, 100, 10_000):
        with pytest.raises(IesError):
            parse_ies(rng.bytes(n))
        with pytest.raises(IesError):
            parse_ies(b"TILT=NONE\n" + rng.bytes(n))
    with pytest.raises(IesError, match="bytes, more than"):
        parse_ies(bytes((16 << 20) + 1))


def test_negative_intensities_are_dark_and_told() -> None:
    found = parse(candela="100 -3 0")
    assert found.profile.candela.tolist() == [[100, 0, 0]]
    assert "1 intensities are negative" in found.notes[0]
