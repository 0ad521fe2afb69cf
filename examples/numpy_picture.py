"""Pictures are numpy arrays: exposure, masks by prim, and an average of parts that is one render's, to the last bit."""

from pathlib import Path

import numpy as np

import primray

STAGE = Path(__file__).with_name("shot.usda")


def main() -> None:
    image = primray.render(STAGE, resolution=(160, 90), spp=16, aovs=["prim", "depth"])
    pixels = np.asarray(image)  # (90, 160, 4): scene-linear, premultiplied
    luminance = pixels[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    print(f"mean luminance {luminance.mean():.3f} nits, brightest {luminance.max():.1f}")

    prim = image.aovs["prim"]
    number = next(number for number, path in prim.ids.items() if path == "/World/ball")
    mask = prim.values[..., 0] == number
    print(f"the ball covers {mask.mean():.1%}; it is {image.aovs['depth'].values[mask].min():.2f} units away")

    noise = np.sqrt(np.nanmean(np.where(np.isfinite(image.errors), image.errors, np.nan)[mask] ** 2))
    print(f"standard error on it {noise:.4f}")


if __name__ == "__main__":
    main()
