"""How often parts are merged although nothing waits for that."""

from __future__ import annotations

from primray_service.dispatcher.parts.merge_run import GUESS_S, MOST_WAITING, SHARE, SHARE_WATCHED, WATCHED_S, MergePace


def test_merges_take_a_share_of_the_time() -> None:
    pace = MergePace(100.0, 2)
    assert not pace.is_due(1, 100.0 + GUESS_S / SHARE - 0.1)
    assert pace.is_due(1, 100.0 + GUESS_S / SHARE)
    pace.began(200.0)
    pace.ended(203.0)
    assert not pace.is_due(1, 203.0 + 3.0 / SHARE - 0.1)
    assert pace.is_due(1, 203.0 + 3.0 / SHARE)


def test_a_larger_one_while_somebody_looks() -> None:
    pace = MergePace(100.0, 2)
    pace.is_watched(102.0)
    assert pace.is_due(1, 100.0 + GUESS_S / SHARE_WATCHED)
    assert not pace.is_due(1, 102.0 + WATCHED_S)


def test_films_do_not_pile_up() -> None:
    pace = MergePace(100.0, 3)
    assert not pace.is_due(3 * MOST_WAITING - 1, 100.0)
    assert pace.is_due(3 * MOST_WAITING, 100.0)


def test_without_parts_there_is_nothing_to_merge() -> None:
    assert not MergePace(100.0, 3).is_due(0, 1e6)
