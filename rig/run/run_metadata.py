"""Start metadata of a run: what was run, by which code, where and when."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path

from comms.channels import VISION_TASKS
from comms.clock import utc_now
from rig.run.job import Job
from rig.run.provenance import provenance
from vision.task import VisionSettings

CODE = Path(__file__).resolve().parents[2]  # folder of the five packages
PACKAGES = ("swayless", "numpy", "scipy", "opencv-python-headless", "pyzmq", "mcap", "msgspec")
CLOCKS = {"wall": "CLOCK_MONOTONIC from the operator's start", "virtual": "virtual"}


def start_metadata(job: Job, mode: str, run_id: str) -> dict[str, str]:
    """Collect the metadata record `run.start` of a run in mode wall or virtual."""
    e = job.experiment.experiment
    return {
        "run_id": run_id,
        "command": job.command,
        "experiment": e.name,
        "kind": e.kind,
        "mode": mode,
        "seed": str(e.seed),
        "purpose": e.purpose,
        "calibration": job.calibration_name,
        "angle_scale": _angle_scale(job),
        "static_scene": _static_scene(job),
        "utc": utc_now().isoformat(),
        "clock": CLOCKS[mode],
        "operator": os.environ.get("USER", "unknown"),
        "host": platform.node(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": " ".join(f"{name}={version(name)}" for name in PACKAGES),
        **provenance(CODE),
    }


def _angle_scale(job: Job) -> str:
    """Say for each camera whether the angles are corrected for its perspective."""
    if job.experiment.camera.rate_hz == 0.0:
        return "no camera"
    seen = _vision_settings(job)
    return ", ".join("corrected" if one.has_angle_scale else "uncorrected" for one in seen)


def _static_scene(job: Job) -> str:
    """Say for each camera whether what never moves is removed from its pictures."""
    if job.experiment.camera.rate_hz == 0.0:
        return "no camera"
    return ", ".join(
        "none" if one.static_scene is None else "removed" for one in _vision_settings(job)
    )


def _vision_settings(job: Job) -> list[VisionSettings]:
    return [job.settings[name] for name in VISION_TASKS if name in job.settings]
