"""Shutter times, and the range of stage time to examine for them, in time codes relative to the frame."""

from __future__ import annotations

from dataclasses import dataclass

from ...description import Exposure


@dataclass(frozen=True)
class Rolling:
    """Rolling shutter, in time codes relative to the frame."""

    opens: float  # `opens` and `closes` are those of the frame's first row and column
    closes: float
    per_column: float
    per_row: float


@dataclass(frozen=True)
class Timing:
    """Shutter of one frame; one that closes when it opens makes a still at that instant. The defaults are a still at the frame.

    `blur_scale` is the largest motion:blurScale on the stage, which widens the range of time to examine. `is_timed`: the stage
    may have time samples at all (splines excepted, which no layer lists).
    """

    opens: float = 0.0
    closes: float = 0.0
    with_frame: bool = False  # the frame's instant is needed, too, for AOVs
    is_timed: bool = False
    blur_scale: float = 1.0
    vectors: tuple[float, float] | None = None  # of a still: shutter interval for motion vectors
    rolling: Rolling | None = None  # within `opens` and `closes`, those of the first and the last line

    @property
    def is_open(self) -> bool:
        """Whether motion is described at all."""
        return self.opens < self.closes or self.vectors is not None

    @property
    def is_frame(self) -> bool:
        """Whether everything is seen as it is at the frame."""
        return self.opens == self.closes == 0.0 and self.vectors is None

    @property
    def span(self) -> tuple[float, float]:
        """Interval for which motion is described."""
        opens, closes = self.vectors or (self.opens, self.closes)
        if self.is_open and self.with_frame:
            return min(opens, self.opens, 0.0), max(closes, self.closes, 0.0)
        return opens, closes

    @property
    def looked_at(self) -> tuple[float, float]:
        """Interval in which changes matter; it includes the frame, from which stills may differ."""
        first, last = self.span
        return min(first * self.blur_scale, 0.0), max(last * self.blur_scale, 0.0)

    def offset(self, fraction: float) -> float:
        """Return the offset from the frame for a fraction of the span."""
        first, last = self.span
        return last if fraction == 1.0 else first + fraction * (last - first)

    @property
    def exposure(self) -> Exposure:
        if (rolling := self.rolling) is not None:
            return Exposure(rolling.opens, rolling.closes, self.span, rolling.per_column, rolling.per_row)
        return Exposure(self.opens, self.closes, self.span)


AT_FRAME = Timing()
