"""From Python: a render with its error, a camera of one's own, a picture that goes on to be a PNG."""

import dataclasses
from pathlib import Path

import primray

STAGE = Path(__file__).with_name("shot.usda")


def main(folder: Path) -> None:
    image = primray.render(STAGE, resolution=(240, 135), spp=16)
    error = image.report["error"]["relmse"]
    print(f"{image!r}: error {error['estimate'] ** 0.5:.1%}, {image.report['rays_per_s'] / 1e6:.1f} million rays/s")
    image.save(folder / "shot.exr")  # the record
    image.save(folder / "shot.png", exposure=0.5)  # a view of it

    closer = dataclasses.replace(image.camera, window=tuple(0.5 * side for side in image.camera.window))
    primray.render(STAGE, camera=closer, resolution=(240, 135), spp=16).save(folder / "closer.png")


if __name__ == "__main__":
    main(Path.cwd())
