"""`rig calibrate camera`: lens of a camera from a chessboard, and its pose from marks."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from comms.clock import utc_now
from rig.errors import ConfigError
from rig.run.calibration import camera_file
from rig.run.calibration.camera_file import CameraFile
from rig.run.calibration.pictures import mean_picture, read_pictures, read_places
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import plain_table, print_paragraph, print_table, print_whole
from vision.camera_model import CameraModel
from vision.chessboard import BoardSize, Intrinsics, calibrate_intrinsics, find_boards
from vision.marks import MeasuredPose, find_marks, find_pose

CORNERS = re.compile(r"(\d{1,2})\s*[xX]\s*(\d{1,2})")
MIN_CORNERS, MAX_CORNERS = 3, 40
PLANES = ("x", "y")
VALUE_NAMES = (
    "focal length, columns [px]",
    "focal length, rows [px]",
    "centre, column [px]",
    "centre, row [px]",
    *("k1", "k2", "p1", "p2"),
)
VALUE_COLUMNS = ("quantity", "value", "sigma")


def camera(
    boards: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[BOARDS]", help="Video, pictures or folder of a chessboard."),
    ] = None,
    corners: Annotated[
        str, typer.Option(metavar="NxM", help="Inner corners of the board, columns x rows.")
    ] = "9x6",
    square_m: Annotated[
        float, typer.Option("--square", min=1e-4, max=10.0, help="Side of a square \\[m].")
    ] = 0.022,
    lens: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Camera file whose lens is kept, in place of BOARDS."),
    ] = None,
    marks: Annotated[
        Path | None,
        typer.Option(help="Picture, folder or video of round marks, the camera at its place."),
    ] = None,
    places: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Places of the marks: x_m,y_m,z_m, right, ahead and up from the pivot at home.",
        ),
    ] = None,
    plane: Annotated[
        str | None,
        typer.Option(help="Plane of the swing that the camera sees, x or y; x, or that of --lens."),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the camera.")] = "camera",
    output: Annotated[
        Path | None,
        typer.Option("--out", help="Camera file; camera_<date>_<name>.toml by default."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Calibrate the lens of a camera on a chessboard, and its pose on marks.

    With --lens the lens is that of a file, and only the pose is new: the camera was moved.
    """
    _check(boards, lens, marks, places, plane)
    size = _board_size(corners, square_m)
    intrinsics: Intrinsics | None = None
    if lens is not None:
        calibrated = camera_file.read(lens)
    else:
        found = find_boards(read_pictures(boards or []), size)
        intrinsics = calibrate_intrinsics(found, size)
        calibrated = _file_of(intrinsics, found.size_px, plane or "x", name)
    pose: MeasuredPose | None = None
    if marks is not None and places is not None:
        seen_plane = plane or calibrated.plane
        pose = _pose(calibrated, marks, places, seen_plane)
        made = utc_now().isoformat(timespec="seconds")
        calibrated = calibrated.with_pose(pose, seen_plane, made)
    path = output or Path(f"camera_{utc_now():%Y-%m-%d}_{calibrated.camera}.toml")
    camera_file.save(calibrated, path)
    refused = intrinsics.refused if intrinsics is not None else {}
    if as_json:
        print_json({"file": str(path), "camera": calibrated, "refused": refused})
        return 0
    _print_camera(calibrated, refused, path)
    return 0


def _check(
    boards: list[Path] | None,
    lens: Path | None,
    marks: Path | None,
    places: Path | None,
    plane: str | None,
) -> None:
    """Raise ConfigError for options that do not go together."""
    if (lens is None) != bool(boards):
        raise ConfigError(
            "BOARDS and --lens; must be one of the two: name pictures of a chessboard, or the file "
            "of a camera whose lens is known"
        )
    if (marks is None) != (places is None):
        raise ConfigError(
            "--marks and --places; must be given together: the picture of the marks, and the file "
            "of their places"
        )
    if lens is not None and marks is None:
        raise ConfigError("--lens without --marks; must have them: there is nothing to calibrate")
    if plane is not None and plane not in PLANES:
        raise ConfigError(f"--plane {plane}; must be x or y: name the plane that the camera sees")


def _board_size(corners: str, square_m: float) -> BoardSize:
    found = CORNERS.fullmatch(corners)
    counts = [int(word) for word in found.groups()] if found else []
    if not counts or min(counts) < MIN_CORNERS or max(counts) > MAX_CORNERS:
        raise ConfigError(
            f"--corners {corners}; must be two numbers of {MIN_CORNERS} to {MAX_CORNERS}, such as "
            "9x6: count the corners between four squares"
        )
    return BoardSize(counts[0], counts[1], square_m)


def _file_of(intrinsics: Intrinsics, size_px: tuple[int, int], plane: str, name: str) -> CameraFile:
    return CameraFile(
        made=utc_now().isoformat(timespec="seconds"),
        camera=name,
        plane="x" if plane == "x" else "y",
        width=size_px[0],
        height=size_px[1],
        focal_px=intrinsics.focal_px,
        centre_px=intrinsics.centre_px,
        distortion=intrinsics.distortion,
        sigma_focal_px=intrinsics.sigma_focal_px,
        sigma_centre_px=intrinsics.sigma_centre_px,
        sigma_distortion=intrinsics.sigma_distortion,
        boards=len(intrinsics.used),
        rms_px=intrinsics.rms_px,
    )


def _pose(calibrated: CameraFile, marks: Path, places: Path, plane: str) -> MeasuredPose:
    picture = mean_picture(read_pictures([marks]))
    if picture.shape != (calibrated.height, calibrated.width):
        raise ConfigError(
            f"'{marks}': {picture.shape[1]} x {picture.shape[0]} px; must be {calibrated.width} x "
            f"{calibrated.height} as the boards: take both with the same camera and size"
        )
    return find_pose(find_marks(picture), read_places(places), calibrated.intrinsics(), plane)


def _print_camera(calibrated: CameraFile, refused: dict[str, str], path: Path) -> None:
    title = f"{calibrated.camera}, {calibrated.width} x {calibrated.height} px"
    table = plain_table(title, VALUE_COLUMNS)
    for row in _rows(calibrated):
        table.add_row(*row)
    print_table(table)
    if calibrated.boards:
        print_paragraph(
            f"{calibrated.boards} poses of the board, reprojection {calibrated.rms_px:.3f} px rms"
        )
    if refused:
        reasons = Counter(refused.values())
        counted = ", ".join(f"{reason} ({count})" for reason, count in reasons.most_common(5))
        print_paragraph(f"{len(refused)} pictures not used: {counted}")
    pose = calibrated.pose
    if pose is not None:
        print_paragraph(f"{pose.marks} marks, reprojection {pose.rms_px:.3f} px rms")
    print_whole(f"written: {path}", "bold")
    if pose is not None:
        print_whole(f"use it with --set vision.camera={shlex.quote(str(path))}")


def _rows(calibrated: CameraFile) -> list[tuple[str, str, str]]:
    rows = []
    values = [*calibrated.focal_px, *calibrated.centre_px, *calibrated.distortion]
    sigmas = [
        *calibrated.sigma_focal_px,
        *calibrated.sigma_centre_px,
        *calibrated.sigma_distortion,
    ]
    for title, value, sigma in zip(VALUE_NAMES, values, sigmas, strict=False):
        digits = 2 if "px" in title else 5
        rows.append((title, f"{value:.{digits}f}", f"{sigma:.{digits}f}"))
    if calibrated.pose is not None:
        centre_m = CameraModel(camera_file.parameters(calibrated)).centre_m
        sigma_m = float(np.linalg.norm(calibrated.pose.sigma_translation_m))
        for axis, place_m in zip("xyz", centre_m, strict=True):
            rows.append((f"place of the camera, {axis} [m]", f"{place_m:.5f}", f"{sigma_m:.5f}"))
    return rows
