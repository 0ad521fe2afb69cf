"""Text of ids in the headers of EXR parts."""

from __future__ import annotations

import json

from primray.images.exr_parts import MOST_IDS, ids_text


def test_long_lists_of_ids_are_cut_and_counted() -> None:
    text = json.loads(ids_text({n: f"/a{n}" for n in range(1, MOST_IDS + 11)}))
    assert len(text) == MOST_IDS + 1
    assert text[""] == "and 10 more"
