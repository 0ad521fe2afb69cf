"""Speed of a render and its remaining time, from the values that its progress callback receives."""

from __future__ import annotations

import time


class Speed:
    """Rates and remaining time, counted from the first call: earlier time is not rendering."""

    def __init__(self) -> None:
        self.start: tuple[float, float, int, int] | None = None

    def __call__(self, fraction: float, samples: int, rays: int) -> dict[str, float | None]:
        now = time.monotonic()
        if self.start is None:
            self.start = (now, fraction, samples, rays)
        elapsed, done = now - self.start[0], fraction - self.start[1]
        per_s = 1 / elapsed if elapsed > 0 else 0.0
        return {
            "samples_per_s": (samples - self.start[2]) * per_s,
            "rays_per_s": (rays - self.start[3]) * per_s,
            "elapsed_s": elapsed,
            "eta_s": 0.0 if fraction >= 1 else elapsed * (1 - fraction) / done if done > 0 else None,
        }


def rate_text(figures: dict[str, float | None]) -> str:
    samples, rays, eta = (figures[name] or 0.0 for name in ("samples_per_s", "rays_per_s", "eta_s"))
    minutes, seconds = divmod(round(eta), 60)
    left = f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}" if figures["eta_s"] is not None else "-:--:--"
    return f"{samples / 1e6:.2f} Msamples/s {rays / 1e6:.1f} Mrays/s ETA {left}"
