"""Cameras that the streamer watches: age of their angles, and the swing before the move."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from comms.channels import MS
from comms.messages import AngleSample, SwingPlane
from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.swing import initial_swing_rad
from rig.run.tasks.pause import PauseMeter


class WatchedCamera(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Camera, and the largest age of its newest valid angle."""

    number: int = 1
    plane: SwingPlane = SwingPlane.X
    stale_ns: int


class _Newest:
    """Newest angle of a camera."""

    def __init__(self) -> None:
        self.valid_ns = 0  # arrival of the newest valid one
        self.invalid_reason = ""  # empty if the newest one is valid


class AngleWatch:
    """Angles of the cameras of a run."""

    def __init__(self, cameras: Sequence[WatchedCamera]) -> None:
        self._cameras = {f"angle_{camera.number}": camera for camera in cameras}
        self._newest = {channel: _Newest() for channel in self._cameras}
        # (t_s, angle_rad) before the move, of all cameras of a plane
        self._quiet: dict[SwingPlane, list[tuple[float, float]]] = {
            camera.plane: [] for camera in cameras
        }

    @property
    def has_cameras(self) -> bool:
        """True in a run with a camera."""
        return bool(self._cameras)

    def take(self, channel: str, sample: AngleSample, t_ns: int, *, is_quiet: bool) -> None:
        """Take an angle that arrived at t_ns; is_quiet: before the move of a run."""
        camera = self._cameras.get(channel)
        if camera is None:
            return
        newest = self._newest[channel]
        cable = sample.cable
        if cable is None:
            newest.invalid_reason = sample.reason.value
            return
        newest.valid_ns = t_ns
        newest.invalid_reason = ""
        if is_quiet:
            self._quiet[camera.plane].append((sample.t_valid_ns * 1e-9, cable.angle_rad))

    def stale(self, t_ns: int, since_ns: int, pause: PauseMeter) -> str | None:
        """Describe a cable angle that is too old, counted from since_ns; None while all are fresh.

        Of several cameras it names the first whose angle is.
        """
        for channel, camera in self._cameras.items():
            newest = self._newest[channel]
            age_ns = t_ns - max(newest.valid_ns, since_ns)
            if age_ns <= camera.stale_ns:
                continue
            reason = "no picture arrived"
            if newest.invalid_reason:
                reason = f"last reason: {newest.invalid_reason}"
            whose = f" of camera {camera.number}" if len(self._cameras) > 1 else ""
            return (
                f"no valid cable angle{whose} for {age_ns / MS:.0f} ms; "
                f"must be <= {camera.stale_ns / MS:.0f} ms ({reason}): "
                f"{pause.cause(age_ns, 'check camera, screen and calibration')}"
            )
        return None

    def initial_swing(self, omega_rad_s: float) -> tuple[float, str]:
        """Fit the swing before the move; return the amplitude of the plane with the larger one.

        Amplitude [rad], and the plane in words where cameras see two. Raises AnalysisError where
        the swing in a plane cannot be measured.
        """
        found: list[tuple[float, str]] = []
        for plane, samples in self._quiet.items():
            where = f" in the plane {plane.value}" if len(self._quiet) > 1 else ""
            t_s = [t for t, _ in samples]
            angle_rad = [angle for _, angle in samples]
            try:
                found.append((initial_swing_rad(t_s, angle_rad, omega_rad_s), where))
            except AnalysisError as error:
                raise AnalysisError(f"{where}: {error}".removeprefix(": ").strip()) from error
        return max(found)
