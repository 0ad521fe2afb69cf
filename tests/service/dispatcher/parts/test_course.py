"""What a frame in parts does next, and when it is over: by its samples, its error, its time."""

from __future__ import annotations

from dataclasses import replace

from primray_service.dispatcher.frames.parts.course import Course
from primray_service.jobs import Frame, Json, Part, PartState

FRAME = Frame("job_x", 0, None)


def begun(stop: Json, merged: int = 0, parts: tuple[Part, ...] = ()) -> Course:
    course = Course(stop, 2)
    course.begin(replace(FRAME, merged=merged), parts)
    return course


def part(first: int, end: int, state: PartState) -> Part:
    return Part("job_x", 0, first, end, state)


def is_over(course: Course) -> bool:
    return course.is_sampled(FRAME, runs=False, merges=False)


def test_by_samples_it_is_over_when_all_are_merged() -> None:
    course = begun({"max_samples": 16})
    while (following := course.next_part(FRAME)) is not None:
        course.ledger.put(replace(following, state=PartState.DONE))
    assert not is_over(course)
    course.merged(16, 0.1, target_met=False)
    assert is_over(course)
    assert course.end == (16, False)


def test_an_odd_sample_is_the_pictures() -> None:
    course = begun({"max_samples": 17}, merged=16)
    assert is_over(course)
    assert course.end == (17, False)


def test_what_came_back_goes_before_what_is_new() -> None:
    course = begun({"max_samples": 64}, parts=(part(0, 8, PartState.RUNNING), part(8, 16, PartState.WAITING)))
    assert course.next_part(FRAME) == part(8, 16, PartState.WAITING)


def test_by_an_error_it_is_over_when_that_is_met_whatever_runs() -> None:
    course = begun({"target_error": 0.1}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.RUNNING)))
    assert not course.is_sampled(FRAME, runs=True, merges=True)
    assert [gone.first for gone in course.merged(8, 0.05, target_met=True)] == [0]
    assert course.is_sampled(FRAME, runs=True, merges=False)
    assert course.next_part(FRAME) is None
    assert course.end == (8, False)


def test_by_time_it_is_over_with_what_is_merged() -> None:
    course = begun({"max_seconds": 10.0}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.WAITING)))
    course.at(10.0, 86_400.0)
    assert course.is_out_of_time
    assert not is_over(course)  # there is one to merge
    course.merged(8, 0.5, target_met=False)
    assert is_over(course)
    assert course.end == (8, True)


def test_a_frame_without_a_sample_is_not_over_by_time() -> None:
    course = begun({"max_seconds": 10.0}, parts=(part(0, 8, PartState.WAITING),))
    course.at(11.0, 86_400.0)
    assert not course.is_out_of_time
    assert not is_over(course)
    assert course.next_part(FRAME) == part(0, 8, PartState.WAITING)


def test_what_is_allowed_in_any_case_ends_it_too() -> None:
    course = begun({"max_samples": 64}, merged=8)
    course.at(5.0, 10.0)
    assert course.known.left_s is None
    course.at(10.0, 10.0)
    assert is_over(course)
    assert course.end == (8, True)
