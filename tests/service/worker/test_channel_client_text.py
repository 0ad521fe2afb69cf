"""What leaves a worker: what the renderer's own names of files miss tells nothing of the machine either."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from primray_service.worker.channel import ClientText

JOB, OUT = Path("/srv/data/slots/x-1/job"), Path("/srv/data/slots/x-1/out")
TEXT = ClientText(JOB, OUT)
ASKED = "Could not open asset @/srv/other/secret.usda@ for reference introduced by @root.usda@</a>"


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (f"{JOB}/shot.usda:3:1: bad", "shot.usda:3:1: bad"),
        (f"@{JOB}/package/a/b.usda@ and <{OUT}/tmp/c.png>", "@a/b.usda@ and <c.png>"),
        (f'File "{sys.prefix}/lib/x.py", line 3', 'File "lib/x.py", line 3'),
        (f"{ASKED} -- secret.usda:1:1: 'its words'.", ASKED.replace("/srv/other", "...") + "."),
        (f"{ASKED}.", ASKED.replace("/srv/other", "...") + "."),
        ("@anon:0x55d6:made.usda@", "@made.usda@"),
        ("/World/tmp/mesh", "/World/tmp/mesh"),
        ("in </job/mesh>", "in </job/mesh>"),
    ],
)
def test_places_of_the_machine_are_left_out(said: str, told: str) -> None:
    assert TEXT.in_text(said) == told


def test_whole_messages_go_through_and_prims_stay() -> None:
    said = {"at": "warning", "prim": f"{JOB}/x", "members": [f"{JOB}/a.png", 3, None, {"detail": f"{OUT}/b"}]}
    assert TEXT.in_json(said) == {**said, "members": ["a.png", 3, None, {"detail": "b"}]}
