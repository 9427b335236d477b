"""Changes to the frames of a real recording after which the lead must be the same: what a lens, a codec, the light, a
cheaper LiDAR or a calibration that is slightly off do, and what must not matter at all (the mirror image)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import cv2
import numpy as np

from pipeline.types import U8, Frame, Mask

Change = Callable[[Frame], Frame]


def as_it_is(frame: Frame) -> Frame:
    return frame


def without_own_motion(frame: Frame) -> Frame:
    return replace(frame, ego=None, gnss=None)


def mirrored(frame: Frame) -> Frame:
    """Left and right exchanged, in the image and its calibration, the sweep and the ego motion."""
    flip = np.diag([1.0, -1.0, 1.0, 1.0])
    if frame.sweep is not None:
        x, y, z = frame.sweep.origin
        points = frame.sweep.points * np.float32([1, -1, 1, 1])
        frame = replace(frame, sweep=replace(frame.sweep, points=points, origin=(x, -y, z)))
    if frame.image is not None:
        frame = _on_image(lambda bgr: bgr[:, ::-1])(frame)
    camera = frame.camera
    if camera is not None:
        K = camera.K.copy()
        K[0, 2] = camera.width - 1 - K[0, 2]
        T = np.diag([-1.0, 1.0, 1.0, 1.0]) @ camera.T_camera_ego @ flip
        frame = replace(frame, camera=replace(camera, K=K, T_camera_ego=T))
    ego = frame.ego
    if ego is not None and ego.yaw_rate_radps is not None:
        frame = replace(frame, ego=replace(ego, yaw_rate_radps=-ego.yaw_rate_radps))
    return replace(frame, gnss=None)


def _on_image(change: Callable[[U8], U8]) -> Change:
    def changed(frame: Frame) -> Frame:
        if frame.image is None:
            return frame
        bgr = np.ascontiguousarray(change(frame.image.bgr))
        return replace(frame, image=replace(frame.image, bgr=bgr, encoded=None))

    return changed


def jpeg(quality: int) -> Change:
    def coded(bgr: U8) -> U8:
        return cv2.imdecode(cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)  # type: ignore[return-value]

    return _on_image(coded)


def brighter(factor: float) -> Change:
    return _on_image(lambda bgr: np.clip(bgr * np.float32(factor), 0, 255).astype(np.uint8))


def blurred(sigma_px: float) -> Change:
    return _on_image(lambda bgr: cv2.GaussianBlur(bgr, (0, 0), sigma_px))  # type: ignore[arg-type,return-value]


def noisy(sigma: float) -> Change:
    def changed(frame: Frame) -> Frame:
        random = np.random.default_rng(frame.index)
        return _on_image(lambda bgr: np.clip(bgr + random.normal(0, sigma, bgr.shape), 0, 255).astype(np.uint8))(frame)

    return changed


def shifted(x_px: int, y_px: int) -> Change:
    """Shifted by whole pixels with the same calibration, as when a mount vibrates."""
    return _on_image(lambda bgr: np.roll(bgr, (y_px, x_px), axis=(0, 1)))


def scaled(factor: float) -> Change:
    """Another resolution, known to the calibration."""

    def changed(frame: Frame) -> Frame:
        if frame.image is None or frame.camera is None:
            return frame
        frame = _on_image(lambda bgr: cv2.resize(bgr, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA))(frame)  # type: ignore[arg-type,return-value]
        assert frame.image is not None
        height, width = frame.image.bgr.shape[:2]
        K = frame.camera.K.copy()  # type: ignore[union-attr]
        K[:2] *= factor
        return replace(frame, camera=replace(frame.camera, K=K, width=width, height=height))  # type: ignore[arg-type]

    return changed


def cropped(frame: Frame) -> Frame:
    """A narrower lens: an eighth less on either side, a tenth less at the top."""
    if frame.image is None or frame.camera is None:
        return frame
    height, width = frame.image.bgr.shape[:2]
    x, y = width // 8, height // 10
    frame = _on_image(lambda bgr: bgr[y:, x : width - x])(frame)
    assert frame.camera is not None
    K = frame.camera.K.copy()
    K[:2, 2] -= x, y
    return replace(frame, camera=replace(frame.camera, K=K, width=width - 2 * x, height=height - y))


def turned(yaw_deg: float = 0.0, pitch_deg: float = 0.0) -> Change:
    """The camera's calibration is wrong by these angles."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.radians([pitch_deg, yaw_deg, 0.0]))[0]

    def changed(frame: Frame) -> Frame:
        if frame.camera is None:
            return frame
        return replace(frame, camera=replace(frame.camera, T_camera_ego=T @ frame.camera.T_camera_ego))

    return changed


def _kept(which: Callable[[Frame], Mask]) -> Change:
    """Only these points of the sweep."""

    def changed(frame: Frame) -> Frame:
        sweep = frame.sweep
        if sweep is None:
            return frame
        keep = which(frame)
        times = sweep.time_s[keep] if sweep.time_s is not None else None
        return replace(
            frame,
            sweep=replace(sweep, points=np.ascontiguousarray(sweep.points[keep]), ring=sweep.ring[keep], time_s=times),
        )

    return changed


def thinned(share: float) -> Change:
    """A random share of the points is removed."""
    return _kept(lambda frame: np.random.default_rng(frame.index).random(len(frame.sweep.points)) >= share)  # type: ignore[union-attr]


def every_other_ring(first: int) -> Change:
    return _kept(lambda frame: frame.sweep.ring % 2 == first)  # type: ignore[union-attr]


IMMATERIAL: Mapping[str, Change] = {
    "JPEG 95": jpeg(95),
    "JPEG 80": jpeg(80),
    "1 px right": shifted(1, 0),
    "1 px left": shifted(-1, 0),
    "1 px down": shifted(0, 1),
    "1 px up": shifted(0, -1),
    "brighter by a tenth": brighter(1.1),
    "darker by a tenth": brighter(0.9),
    "every fifth box missing": as_it_is,
    "a tenth of the points missing": thinned(0.1),
}
"""Changes that must not matter. Boxes are left out by the detector (``real_variants``)."""
HARSH: Mapping[str, Change] = {
    "mirrored": mirrored,
    "no ego motion": without_own_motion,
    "mirrored, no ego motion": lambda frame: without_own_motion(mirrored(frame)),
    "JPEG 60": jpeg(60),
    "dark": brighter(0.6),
    "light": brighter(1.4),
    "noise": noisy(12.0),
    "blur": blurred(1.5),
    "narrow lens": cropped,
    "half the resolution": scaled(0.5),
    "three quarters": scaled(0.75),
    "1.3 times": scaled(1.3),
    "3 of 10 points missing": thinned(0.3),
    "even rings": every_other_ring(0),
    "odd rings": every_other_ring(1),
    "yaw off by 0.3°": turned(0.3),
    "yaw off by −0.3°": turned(-0.3),
    "pitch off by 0.3°": turned(pitch_deg=0.3),
    "pitch off by −0.3°": turned(pitch_deg=-0.3),
}
"""Changes that cost something, but no lead and no braking."""
