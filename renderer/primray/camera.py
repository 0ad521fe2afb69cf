"""Cameras: placement, window and lens. Part of the description; users may pass one to a render."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from .arrays import Doubles
from .errors import SettingsError
from .lens.diffusion import NO_DIFFUSION, Diffusion, diffusion_of
from .lens.distortion import CUBE_FACES, Distortion, DistortionModel, distortion_as_json, distortion_of

FARTHEST = float(np.finfo(np.float32).max)  # far plane of a camera that clips nothing
RATIONAL_COUNTS = (0, 4, 5, 8, 12)  # of OpenCV's coefficients; its 14 tilt the sensor
FISHEYE_COUNT = 4


class Projection(Enum):
    """Projection of a camera: rays from one eye, or parallel rays.

    >>> primray.Projection("perspective")
    <Projection.PERSPECTIVE: 'perspective'>
    """

    PERSPECTIVE = "perspective"
    ORTHOGRAPHIC = "orthographic"


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: placement, window and lens. It looks along -Z of its space, +Y up, +X to the right.

    `world_from_camera` (4, 4), float64, is a rigid transform from camera to world space for points as column vectors, in
    scene units: its first three columns are the camera's right, up and backward directions, its last one the position.
    `window` is (left, right, bottom, top) of the whole frame at unit distance (perspective) or in scene units
    (orthographic); for a lens with distortion, the frame's sides on the film. `Image.camera` is the camera of an image, which
    can be changed and passed to another render:

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=2)
    >>> moved = image.camera.world_from_camera.copy()
    >>> moved[:3, 3] += 0.1 * moved[:3, 2]  # a tenth of a unit back
    >>> camera = dataclasses.replace(image.camera, world_from_camera=moved)
    >>> primray.render("shot.usda", camera=camera, resolution=(32, 18), spp=2).resolution
    (32, 18)

    A render conforms the window to the image's aspect ratio by UsdRenderSettings' aspectRatioConformPolicy.
    """

    path: str  # of its prim; "": none
    world_from_camera: Doubles
    projection: Projection
    window: tuple[float, float, float, float]
    clipping_range: tuple[float, float]  # scene units along -Z
    lens_radius: float = 0.0  # scene units; 0: pinhole
    focus_distance: float = 0.0  # scene units, along -Z
    exposure_scale: float = 1.0  # multiplies the image
    # Sides of the aperture, a regular polygon with its corners on the circle of `lens_radius`; 0: a circle.
    blades: int = 0
    blade_rotation_deg: float = 0.0  # of a corner from +X, towards +Y
    clipping_planes: tuple[tuple[float, float, float, float], ...] = ()  # a x + b y + c z + d < 0 is clipped, camera space
    shutter: tuple[float, float] = (0.0, 0.0)  # opens and closes, in time codes relative to the frame; equal: an instant
    diffusion: Diffusion = NO_DIFFUSION  # in the lens, applied after the render
    distortion: Distortion | None = None  # of a perspective camera
    # Flaws of a perspective camera's lens. Natural vignetting: cos^4 of a ray's angle to the axis. Mechanical vignetting:
    # distance of a second opening, the rim, in front of the lens, and its radius, in scene units (radius 0: none). Chromatic
    # aberration, for red, green and blue: magnification about the axis, and shift of the focus distance.
    natural_vignetting: bool = False
    rim: tuple[float, float] = (0.0, 0.0)
    channel_magnification: tuple[float, float, float] = (1.0, 1.0, 1.0)
    channel_focus_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # Distance from which on things must be placed to a thousandth of a pixel, in scene units; 0: that of the near plane. Of
    # cameras that are close to each other and have the same, all points of a scene that stays are shared.
    nearest: float = 0.0
    # The pixels take the shape of the window, rather than the window that of the picture: where they are not square, as in an
    # intrinsic matrix whose fx is not fy.
    pixels_follow_window: bool = False

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Camera) and camera_as_json(self) == camera_as_json(other)

    def __hash__(self) -> int:
        return hash((self.path, self.projection, self.window))

    @staticmethod
    def from_intrinsics(
        matrix: npt.ArrayLike,
        resolution: tuple[int, int],
        world_from_camera: npt.ArrayLike | None = None,
        distortion: npt.ArrayLike = (),
        *,
        fisheye: bool = False,
        half_pixels: bool = False,
        clipping_range: tuple[float, float] = (0.0, FARTHEST),
    ) -> Camera:
        """Return the pinhole camera of OpenCV's intrinsic matrix K for pictures of `resolution` (width, height).

        `matrix` (3, 3) is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels. OpenCV, ROS, KITTI and BOP count middles of pixels
        as whole numbers: (0, 0) is the middle of the upper left pixel. `half_pixels` says that (0.5, 0.5) is, as `project`
        counts. `distortion` is in OpenCV's order: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]], without units, the radius being
        the tangent of the angle to the axis; with `fisheye`, k1 k2 k3 k4 of cv2.fisheye, powers of the angle in radians
        ("Camera Calibration and 3D Reconstruction", "Fisheye camera model"). `world_from_camera` is Camera's, not OpenCV's,
        whose camera has +Y down and looks along +Z (`opencv_camera_from_world`); the identity by default.

        SettingsError: a matrix that is none of a camera or has skew, coefficients of another number.

        >>> k = [[100.0, 0.0, 63.5], [0.0, 100.0, 31.5], [0.0, 0.0, 1.0]]
        >>> primray.Camera.from_intrinsics(k, (128, 64)).window
        (-0.64, 0.64, -0.32, 0.32)
        """
        width, height = resolution
        k = _matrix(matrix, (3, 3), "an intrinsic matrix")
        (fx, skew, cx), (zero, fy, cy), last = k.tolist()
        if skew or zero or last != [0.0, 0.0, 1.0] or not (fx > 0 and fy > 0):
            raise SettingsError(
                "an intrinsic matrix is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], fx and fy above 0", where="camera"
            )
        half = 0.0 if half_pixels else 0.5
        window = (-(cx + half) / fx, (width - cx - half) / fx, -(height - cy - half) / fy, (cy + half) / fy)
        return Camera(
            path="",
            world_from_camera=np.eye(4)
            if world_from_camera is None
            else _matrix(world_from_camera, (4, 4), "world_from_camera"),
            projection=Projection.PERSPECTIVE,
            window=window,
            clipping_range=clipping_range,
            distortion=_opencv_distortion(np.asarray(distortion, np.float64).ravel().tolist(), fisheye),
            pixels_follow_window=fx != fy,
        )

    @staticmethod
    def from_field_of_view(
        angle_deg: float,
        resolution: tuple[int, int],
        world_from_camera: npt.ArrayLike | None = None,
        *,
        axis: str = "horizontal",
        clipping_range: tuple[float, float] = (0.0, FARTHEST),
    ) -> Camera:
        """Return the pinhole camera that sees `angle_deg` between opposite sides of pictures of `resolution` (width, height).

        `axis` is "horizontal", "vertical" or "diagonal" (between opposite corners). SettingsError: an angle that is not between
        0 and 180 degrees, another axis.

        >>> primray.Camera.from_field_of_view(90.0, (200, 100)).window
        (-1.0, 1.0, -0.5, 0.5)
        """
        width, height = resolution
        sides = {"horizontal": width, "vertical": height, "diagonal": float(np.hypot(width, height))}
        if axis not in sides:
            raise SettingsError(f"axis must be one of {', '.join(map(repr, sides))}, not {axis!r}", where="camera")
        if not 0 < angle_deg < 180:
            raise SettingsError(f"a field of view is between 0 and 180 degrees, not {angle_deg}", where="camera")
        focal = sides[axis] / (2 * np.tan(np.radians(angle_deg) / 2))
        k = [[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]]
        return Camera.from_intrinsics(
            np.round(k, 12), resolution, world_from_camera, half_pixels=True, clipping_range=clipping_range
        )

    def intrinsics(self, resolution: tuple[int, int], *, half_pixels: bool = False) -> Doubles:
        """Return the intrinsic matrix K (3, 3) of pictures of `resolution` (width, height), as from_intrinsics takes it.

        SettingsError: an orthographic camera or a panorama, which have none. What K lacks (distortion, blur) is left out.

        >>> primray.Camera.from_field_of_view(90.0, (200, 100)).intrinsics((200, 100)).tolist()
        [[100.0, 0.0, 99.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
        """
        if self.projection is not Projection.PERSPECTIVE:
            raise SettingsError("an orthographic camera has no intrinsic matrix", where="camera")
        if self.is_panorama:
            raise SettingsError("a panorama has no intrinsic matrix", where="camera")
        left, right, bottom, top = self.window
        fx, fy = resolution[0] / (right - left), resolution[1] / (top - bottom)
        half = 0.0 if half_pixels else 0.5
        return np.array([[fx, 0.0, -left * fx - half], [0.0, fy, top * fy - half], [0.0, 0.0, 1.0]])

    @property
    def is_panorama(self) -> bool:
        """Whether the picture is equirectangular or a cube's faces."""
        return self.distortion is not None and self.distortion.model in (DistortionModel.LAT_LONG, DistortionModel.CUBE)

    @property
    def environment_map(self) -> str:
        """What OpenImageIO calls the picture as an environment map of OpenEXR: all around, or a column of faces."""
        if self.distortion is None:
            return ""
        if self.distortion.model is DistortionModel.CUBE:
            return "CubeFace Environment" if self.distortion.coefficients[0] == 1 else ""
        is_whole = bool(np.allclose(self.window, (-np.pi, np.pi, -np.pi / 2, np.pi / 2)))
        is_lat_long = self.distortion.model is DistortionModel.LAT_LONG and not self.distortion.has_eyes
        return "LatLong Environment" if is_lat_long and is_whole else ""

    @property
    def opengl_camera_from_world(self) -> Doubles:
        """The view matrix (4, 4) for points as column vectors; the camera looks along -Z, +Y up, as USD's and OpenGL's do."""
        return np.asarray(np.linalg.inv(np.asarray(self.world_from_camera, np.float64)))

    @property
    def opencv_camera_from_world(self) -> Doubles:
        """OpenCV's [R | t] as (4, 4) for points as column vectors; the camera looks along +Z, +Y down (ROS' optical frame)."""
        return np.asarray(np.diag([1.0, -1.0, -1.0, 1.0]) @ self.opengl_camera_from_world)

    @property
    def opengl_projection(self) -> Doubles:
        """OpenGL's projection matrix (4, 4) for column vectors; NDC from -1 (left, bottom, near) to 1 (right, top, far).

        That of glFrustum, or glOrtho for an orthographic camera, in float64: without distortion. A camera that clips nothing
        has a near plane at 0, and so a third row that says no depth.
        """
        left, right, bottom, top = self.window
        near, far = self.clipping_range
        across, up, deep = right - left, top - bottom, far - near
        if self.projection is Projection.ORTHOGRAPHIC:
            rows = [
                [2 / across, 0, 0, -(right + left) / across],
                [0, 2 / up, 0, -(top + bottom) / up],
                [0, 0, -2 / deep, -(far + near) / deep],
                [0, 0, 0, 1],
            ]
        else:
            rows = [
                [2 / across, 0, (right + left) / across, 0],
                [0, 2 / up, (top + bottom) / up, 0],
                [0, 0, -(far + near) / deep, -2 * (far / deep) * near],
                [0, 0, -1, 0],
            ]
        return np.array(rows, np.float64)

    @staticmethod
    def lat_long(
        world_from_camera: npt.ArrayLike | None = None,
        *,
        span_deg: tuple[float, float] = (360.0, 180.0),
        eye_distance: float = 0.0,
        side_by_side: bool = False,
        clipping_range: tuple[float, float] = (0.0, FARTHEST),
    ) -> Camera:
        """Return a camera that sees all around, in an equirectangular picture: columns are longitudes, rows latitudes.

        The middle looks along -Z, the upper row is +Y, the right half +X: u = 0.5 + atan2(x, -z) / 2 pi, v = 0.5 - asin(y) / pi
        of a unit direction, from the upper left. `span_deg` is the extent in longitude and latitude; (180, 180) is the half in
        front. With an `eye_distance` in scene units (people's is 0.064 m) two eyes see, each on a circle across the direction
        that it looks in, and both in its middle at the poles (omni-directional stereo): the left eye's picture is above the
        right one's or, `side_by_side`, left of it. Pixels take the window's shape: 2:1 pictures have square ones, those of two
        eyes above each other 1:1.

        SettingsError: a span that is not above 0, or above (360, 180); an eye distance below 0.

        >>> primray.Camera.lat_long().project([[0, 0, -1], [1, 0, 0], [0, 1, 0]], (360, 180)).round(6).tolist()
        [[180.0, 90.0], [270.0, 90.0], [180.0, 0.0]]
        """
        across, up = span_deg
        if not (0 < across <= 360 and 0 < up <= 180 and 0 <= eye_distance < np.inf):
            raise SettingsError("a span is up to 360 by 180 degrees, and an eye distance 0 or more", where="camera")
        x, y = float(np.radians(across)) / 2, float(np.radians(up)) / 2
        half = x if side_by_side else y
        distortion = Distortion(DistortionModel.LAT_LONG, (float(eye_distance), float(side_by_side), half))
        if eye_distance:
            x, y = (2 * x, y) if side_by_side else (x, 2 * y)
        return _around(world_from_camera, (-x, x, -y, y), distortion, clipping_range)

    @staticmethod
    def cube(
        world_from_camera: npt.ArrayLike | None = None,
        *,
        columns: int = 1,
        clipping_range: tuple[float, float] = (0.0, FARTHEST),
    ) -> Camera:
        """Return a camera that sees all around, in the six faces of a cube in one picture: +X, -X, +Y, -Y, +Z, -Z of its space.

        Faces are seen from within, +Y up; +Y's up is +Z, -Y's is -Z: as OpenEXR has them in a column. `columns` is 1, 2, 3 or
        6, faces row by row; `cube_face` is the camera of one face. A pixel filter wider than a pixel mixes faces at borders.

        SettingsError: another number of columns.

        >>> primray.Camera.cube().project([[1, 0, 0], [0, 0, -1]], (10, 60)).tolist()
        [[5.0, 5.0], [5.0, 55.0]]
        """
        if columns not in (1, 2, 3, 6):
            raise SettingsError(f"a cube's faces are in 1, 2, 3 or 6 columns, not {columns}", where="camera")
        window = (0.0, float(columns), -6.0 / columns, 0.0)
        return _around(world_from_camera, window, Distortion(DistortionModel.CUBE, (float(columns),)), clipping_range)

    def cube_face(self, name: str) -> Camera:
        """Return the pinhole camera of one face of a cube camera's picture: "+X", "-X", "+Y", "-Y", "+Z" or "-Z" of its space.

        Its `world_from_camera` is the face's matrix.

        >>> primray.Camera.cube().cube_face("+X").world_from_camera[:3, :3].tolist()
        [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
        """
        if name not in CUBE_FACES:
            raise SettingsError(f"a cube has the faces {', '.join(CUBE_FACES)}, not {name!r}", where="camera")
        right, up = (np.array(axis) for axis in CUBE_FACES[name])
        turn = np.eye(4)
        turn[:3, :3] = np.stack([right, up, np.cross(right, up)], axis=1) + 0.0
        return replace(
            self,
            world_from_camera=np.asarray(self.world_from_camera, np.float64) @ turn,
            window=(-1.0, 1.0, -1.0, 1.0),
            distortion=None,
            pixels_follow_window=False,
        )

    def project(self, points: npt.ArrayLike, resolution: tuple[int, int], *, right_eye: bool = False) -> Doubles:
        """Return pixel positions (N, 2), x right and y down from the upper left corner, of world `points` (N, 3).

        NaN for points behind a perspective camera, or that a lens with distortion does not see. In a picture of two eyes they
        are in the left eye's half or, `right_eye`, in the right one's.
        """
        p = np.atleast_2d(np.asarray(points, np.float64))
        camera_from_world = np.linalg.inv(self.world_from_camera)
        q = p @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        xy = q[:, :2].copy()
        if self.distortion is not None and self.projection is Projection.PERSPECTIVE:
            xy = self.distortion.project(q, right_eye=right_eye)
        elif self.projection is Projection.PERSPECTIVE:
            depth = np.where(q[:, 2] < 0, -q[:, 2], np.nan)
            xy /= depth[:, None]
        left, right, bottom, top = self.window
        width, height = resolution
        return np.stack([(xy[:, 0] - left) / (right - left) * width, (top - xy[:, 1]) / (top - bottom) * height], axis=1)


def looking_at(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0.0, 1.0, 0.0)) -> Doubles:
    """Return `world_from_camera` (4, 4) of a camera at `eye` that looks at `target`, upright by `up`; world points (3,).

    SettingsError: eye and target are one point, or `up` is along the view.

    >>> primray.looking_at((0, 0, 5), (0, 0, 0)).tolist()[2]
    [0.0, 0.0, 1.0, 5.0]
    """
    place, aim, upwards = (np.asarray(p, np.float64) for p in (eye, target, up))
    backward = place - aim
    right = np.cross(upwards, backward)
    if not np.linalg.norm(right) > 1e-12 * np.linalg.norm(upwards) * np.linalg.norm(backward):
        raise SettingsError("eye and target must be apart, and up not along the view", where="camera")
    backward /= np.linalg.norm(backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(backward, right), backward, place], axis=1)
    return matrix


def _around(
    world_from_camera: npt.ArrayLike | None,
    window: tuple[float, float, float, float],
    distortion: Distortion,
    clipping_range: tuple[float, float],
) -> Camera:
    """Return a camera that sees all around."""
    return Camera(
        path="",
        world_from_camera=np.eye(4) if world_from_camera is None else _matrix(world_from_camera, (4, 4), "world_from_camera"),
        projection=Projection.PERSPECTIVE,
        window=window,
        clipping_range=clipping_range,
        distortion=distortion,
        pixels_follow_window=True,
    )


def _matrix(values: npt.ArrayLike, shape: tuple[int, int], what: str) -> Doubles:
    matrix = np.asarray(values, np.float64)
    if matrix.shape != shape or not np.isfinite(matrix).all():
        raise SettingsError(f"{what} has {shape[0]} x {shape[1]} finite numbers", where="camera")
    return matrix


def _opencv_distortion(coefficients: list[float], fisheye: bool) -> Distortion | None:
    """Return the distortion of OpenCV's coefficients; None where all are 0 in a lens that is no fisheye."""
    if fisheye:
        if len(coefficients) not in (0, FISHEYE_COUNT):
            raise SettingsError(f"cv2.fisheye has {FISHEYE_COUNT} coefficients, not {len(coefficients)}", where="camera")
        return Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, *(coefficients or [0.0] * FISHEYE_COUNT)))
    tilted = coefficients[max(RATIONAL_COUNTS) :]
    if len(tilted) == 2 and not any(tilted):
        coefficients = coefficients[: max(RATIONAL_COUNTS)]
    if len(coefficients) not in RATIONAL_COUNTS:
        counts = ", ".join(map(str, RATIONAL_COUNTS))
        raise SettingsError(
            f"a lens has {counts} of OpenCV's coefficients (a tilted sensor is not modelled), not {len(coefficients)}",
            where="camera",
        )
    if not any(coefficients):
        return None
    return Distortion(DistortionModel.RATIONAL, tuple(coefficients + [0.0] * (max(RATIONAL_COUNTS) - len(coefficients))))


def camera_as_json(camera: Camera) -> dict[str, Any]:
    """Return a camera as JSON-compatible values."""
    matrix = np.asarray(camera.world_from_camera, np.float64)
    plain = asdict(replace(camera, distortion=None)) | {
        "world_from_camera": matrix.tolist(),
        "projection": camera.projection.value,
    }
    if not camera.pixels_follow_window:
        del plain["pixels_follow_window"]
    return plain | {"distortion": distortion_as_json(camera.distortion)}


def camera_of(values: Mapping[str, Any]) -> Camera:
    """Return the camera that camera_as_json serialized; ValueError, KeyError or TypeError for anything else."""
    matrix = np.array(values["world_from_camera"], np.float64)
    left, right, bottom, top = map(float, values["window"])
    near, far = map(float, values["clipping_range"])
    if not (matrix.shape == (4, 4) and right != left and top != bottom and near != far):
        raise ValueError
    distance, radius = map(float, values.get("rim", (0.0, 0.0)))
    red, green, blue = map(float, values.get("channel_magnification", (1.0, 1.0, 1.0)))
    of_red, of_green, of_blue = map(float, values.get("channel_focus_shift", (0.0, 0.0, 0.0)))
    return Camera(
        path=str(values["path"]),
        world_from_camera=matrix,
        projection=Projection(values["projection"]),
        window=(left, right, bottom, top),
        clipping_range=(near, far),
        lens_radius=float(values["lens_radius"]),
        focus_distance=float(values["focus_distance"]),
        exposure_scale=float(values["exposure_scale"]),
        blades=int(values["blades"]),
        blade_rotation_deg=float(values["blade_rotation_deg"]),
        clipping_planes=tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in values["clipping_planes"]),
        shutter=(float(values["shutter"][0]), float(values["shutter"][1])),
        diffusion=diffusion_of(values["diffusion"]) if "diffusion" in values else NO_DIFFUSION,
        distortion=distortion_of(values.get("distortion")),
        natural_vignetting=bool(values.get("natural_vignetting", False)),
        rim=(distance, radius),
        channel_magnification=(red, green, blue),
        channel_focus_shift=(of_red, of_green, of_blue),
        nearest=float(values.get("nearest", 0.0)),
        pixels_follow_window=bool(values.get("pixels_follow_window", False)),
    )
