"""When the shutter is open, and what of the stage's time has to be looked at for that. In time codes from the frame on."""

from __future__ import annotations

from dataclasses import dataclass

from ...description import Exposure


@dataclass(frozen=True)
class Rolling:
    """A shutter that opens for one line after the other; in time codes from the frame on."""

    opens: float  # and closes, for the first row and column of the frame
    closes: float
    per_column: float
    per_row: float


@dataclass(frozen=True)
class Timing:
    """A shutter that closes when it opens makes a still of that instant; these defaults: of the frame.

    `blur_scale`: the largest motion:blurScale on the stage, by which what is looked at is wider than the shutter.
    `is_timed`: the stage may have values for times at all, splines apart, which no layer lists.
    """

    opens: float = 0.0
    closes: float = 0.0
    with_frame: bool = False  # the frame is asked for as well: by AOVs, which show its instant
    is_timed: bool = False
    blur_scale: float = 1.0
    vectors: tuple[float, float] | None = None  # of a still: the shutter that motion vectors are asked for over
    rolling: Rolling | None = None  # within `opens` and `closes`, which are of the first and the last line

    @property
    def is_open(self) -> bool:
        """Whether it is given how things move."""
        return self.opens < self.closes or self.vectors is not None

    @property
    def is_frame(self) -> bool:
        """Everything is seen as it stands at the frame."""
        return self.opens == self.closes == 0.0 and self.vectors is None

    @property
    def span(self) -> tuple[float, float]:
        """What motion is given for."""
        opens, closes = self.vectors or (self.opens, self.closes)
        if self.is_open and self.with_frame:
            return min(opens, self.opens, 0.0), max(closes, self.closes, 0.0)
        return opens, closes

    @property
    def looked_at(self) -> tuple[float, float]:
        """Within which something must change to matter: the frame counts, as what stills are told apart from."""
        first, last = self.span
        return min(first * self.blur_scale, 0.0), max(last * self.blur_scale, 0.0)

    def offset(self, fraction: float) -> float:
        """Of a fraction of the span."""
        first, last = self.span
        return last if fraction == 1.0 else first + fraction * (last - first)

    @property
    def exposure(self) -> Exposure:
        if (rolling := self.rolling) is not None:
            return Exposure(rolling.opens, rolling.closes, self.span, rolling.per_column, rolling.per_row)
        return Exposure(self.opens, self.closes, self.span)


AT_FRAME = Timing()
