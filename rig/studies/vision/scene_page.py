"""Page of the shipped scenes, with a thumbnail of each.

Usage: `python -m rig.studies.vision.scene_page docs` writes docs/scenes.md and docs/scenes/*.jpg.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

from rig.studies.vision.scene import Scene, colour_planes, read_scene, scene_frames, shipped_scenes

PICTURES = "scenes"  # folder beside the page
WIDTH_PX = 200
FRAME = 10  # 0.2 s after the release, at 50 Hz
COLUMNS = 4
QUALITY = 75
HEAD = """# The scenes

Generated from `rig/studies/vision/scenes` by `make docs`. A scene is a TOML file: a table `[scene]`
with what a tracker must do, and the tables `[camera]` and `[bench.*]` of an experiment
([vision.md](vision.md)). `rig sim --scene NAME --video v.avi --truth t.csv` renders one, `rig track
--benchmark --scenes NAME` tries trackers on it. Each picture is taken 0.2 s after the release of
the load.

"""


def page() -> str:
    """Format the page as Markdown: rows of pictures, each with its caption below."""
    scenes = [read_scene(name) for name in shipped_scenes()]
    lines = ["|" + " |" * COLUMNS, "|" + "---|" * COLUMNS]
    for first in range(0, len(scenes), COLUMNS):
        row = scenes[first : first + COLUMNS]
        missing = [""] * (COLUMNS - len(row))
        lines.append("|" + "|".join([*map(_cell, row), *missing]) + "|")
    return HEAD + "\n".join(lines) + "\n"


def _cell(scene: Scene) -> str:
    must = "" if scene.expect == "angle" else " (to be refused)"
    picture = f"![{scene.name}]({PICTURES}/{scene.name}.jpg)"
    return f"{picture}<br>`{scene.name}`{must}: {scene.about}"


def write_pictures(folder: Path) -> None:
    """Write a thumbnail of each scene; one that is there of another scene is removed."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.jpg"):
        old.unlink()
    for name in shipped_scenes():
        scene = read_scene(name)
        *_, frame = scene_frames(scene, min(FRAME + 1, scene.section.frames))
        last = colour_planes(scene).colour(frame.picture, frame.number)
        height = round(WIDTH_PX * last.shape[0] / last.shape[1])
        small = cv2.resize(last, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / f"{name}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def main(folder: Path) -> None:
    """Write page and pictures into a folder."""
    (folder / "scenes.md").write_text(page())
    write_pictures(folder / PICTURES)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
