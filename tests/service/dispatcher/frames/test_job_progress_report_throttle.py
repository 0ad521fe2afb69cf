"""How often progress is told."""

from __future__ import annotations

from primray_service.dispatcher.frames.job_progress import ReportThrottle


def test_progress_is_told_often_at_first_and_seldom_later() -> None:
    """Of a render that has news ten times a second for two hours."""
    throttle, told = ReportThrottle(0.0), []
    for tick in range(72_000):
        if throttle.takes_event("progress", tick / 10):
            told.append(tick / 10)
    first_hour = [at for at in told if at < 3600]
    assert told[:4] == [0.0, 0.5, 1.0, 1.5]
    assert 300 < len(first_hour) < 600
    assert len(told) - len(first_hour) <= 361


def test_many_frames_share_what_the_database_takes():
    throttle = ReportThrottle(0.0)
    throttle.reported(0.0, running=10)
    assert throttle.report_in(0.0) == 0.5
    throttle.reported(0.0, running=1000)
    assert throttle.report_in(0.0) == 20.0
