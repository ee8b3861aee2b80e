"""Sizing file (TOML): an axis, its cycle and its requirements; and the catalogue of screws."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import resources
from typing import Any, NamedTuple, TypeVar

import msgspec

from planners import bounds
from planners.errors import PlanError, check_range, unknown_name
from rig.drives.motor import Motor
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.balls import Balls
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.cycle import Cycle, Move
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.requirements import Requirements, Utilisation
from rig.drives.screw.shaft import Mounting
from rig.drives.screw.supports import SUPPORTS
from rig.drives.screw.transmission import Transmission
from rig.errors import ConfigError
from rig.run.toml_file import Section, convert, rename_keys
from rig.studies.sizing.motor_task import MotorSection

T = TypeVar("T")
# worked axis of source 004, appendix C; the figures that it prints are in NAME_published.toml
EXAMPLES = ("appendix",)
RENAMED_TABLES = {"wishes": "requirements", "shares": "utilisation"}


class AxisSection(Section, frozen=True, kw_only=True):
    """`[axis]`: moved mass, slope, friction and force."""

    mass_kg: float
    slope_deg: float = 0.0
    friction_coefficient: float = 0.0
    force_n: float = 0.0
    carried_kg: float = 0.0


class ScrewSection(Section, frozen=True, kw_only=True):
    """`[screw]`: length, supports and material; no diameter and lead."""

    length_m: float
    support: str = "fixed-supported"
    free_length_m: float | None = None
    density_kg_m3: float = 7800.0
    youngs_modulus_pa: float = 200e9
    shear_modulus_pa: float = 79.3e9
    whirl_coefficient: float | None = None
    buckling_coefficient: float | None = None
    bearing_n_m: float = math.inf
    nut_n_m: float = math.inf


class BallsSection(Section, frozen=True, kw_only=True):
    """`[balls]`: material and speed limit."""

    material: str = "steel"
    limit_m_rpm: float | None = None


class UtilisationSection(Section, frozen=True, kw_only=True):
    """`[utilisation]`: share of each limit that may be used, and the service factor."""

    whirl: float = 0.7
    buckling: float = 0.5
    balls: float = 1.0
    bandwidth: float = 0.5
    service_factor: float = 1.2
    preload: float = 0.0


class RequirementsSection(Section, frozen=True, kw_only=True):
    """`[requirements]`: bounds to meet; unspecified ones are reported without a bound."""

    life_h: float | None = None
    lead_class: str | None = None
    travel_deviation_m: float | None = None
    position_error_m: float | None = None
    angle_error_rad: float | None = None
    sag_m: float | None = None
    stiffness_n_m: float | None = None
    bandwidth_rad_s: float | None = None


class TransmissionSection(Section, frozen=True, kw_only=True):
    """`[transmission]`: inertias of motor and coupling, efficiency and drag."""

    efficiency: float = 0.9
    motor_inertia_kg_m2: float = 0.0
    coupling_inertia_kg_m2: float = 0.0
    drag_torque_n_m: float | None = None
    hold: str = "motor"


class CycleMoveSection(Section, frozen=True, kw_only=True):
    """`[[move]]`: move from rest to rest; the moves are in the order of time."""

    stroke_m: float
    time_s: float
    lambda_acc: float | None = None
    lambda_dec: float | None = None
    rest_s: float = 0.0
    law: str = "trapezoidal"
    durations_s: tuple[float, ...] | None = None


class EntrySection(Section, frozen=True, kw_only=True):
    """`[[catalogue]]`: screw or linear unit with the origin of its figures."""

    name: str
    diameter_m: float
    lead_m: float
    origin: str
    dynamic_load_n: float | None = None
    static_load_n: float | None = None
    preload_n: float | None = None
    core_diameter_m: float | None = None
    ball_circle_m: float | None = None
    limit_m_rpm: float | None = None
    speed_m_s: float | None = None
    stroke_m: float | None = None
    lead_class: str | None = None


class PublishedFigure(Section, frozen=True, kw_only=True):
    """`[published]` name = { printed, reason }: a printed figure, and why the right one differs."""

    printed: str
    reason: str = ""


class SizingFile(Section, frozen=True, kw_only=True):
    """Whole sizing file; tables in lists and in optional sections are converted one by one."""

    axis: AxisSection
    screw: ScrewSection
    balls: BallsSection = BallsSection()
    utilisation: UtilisationSection = UtilisationSection()
    requirements: RequirementsSection = RequirementsSection()
    transmission: TransmissionSection = TransmissionSection()
    motor: dict[str, Any] | None = None
    move: list[dict[str, Any]]
    choice: str = ""  # name of a catalogue entry
    catalogue: list[dict[str, Any]] = []  # entries besides the shipped ones
    published: dict[str, dict[str, Any]] = {}


class Sizing(NamedTuple):
    """Axis, catalogue, choice and published figures of a sizing file."""

    axis: AxisSpec
    catalogue: dict[str, CatalogueEntry]
    choice: CatalogueEntry | None
    published: dict[str, PublishedFigure]


def example_tables(name: str) -> dict[str, Any]:
    """Return the tables of a shipped sizing file. Raises PlanError for a name not in EXAMPLES."""
    if name not in EXAMPLES:
        raise unknown_name("--example", name, EXAMPLES)
    return _shipped(name) | _shipped(f"{name}_published")


def sizing_of(tables: dict[str, Any]) -> Sizing:
    """Build the sizing of a file's tables, with the shipped catalogue.

    Tables of an old name (RENAMED_TABLES) are accepted with a RenamedKey warning. Raises
    ConfigError naming section, key, value and bound, and PlanError for an invalid axis.
    """
    tables = dict(tables)
    rename_keys(tables, RENAMED_TABLES)
    file = convert(tables, SizingFile)
    catalogue = _catalogue([*_shipped("catalogue")["catalogue"], *file.catalogue])
    if file.choice and file.choice not in catalogue:
        raise unknown_name("choice", file.choice, catalogue)
    published = {
        name: convert(row, PublishedFigure, f"published.{name}")
        for name, row in file.published.items()
    }
    return Sizing(_axis(file), catalogue, catalogue.get(file.choice), published)


def _axis(file: SizingFile) -> AxisSpec:
    return AxisSpec(
        mounting=_mounting(file.screw),
        load=_load(file.axis),
        cycle=Cycle([_move(number, row) for number, row in enumerate(file.move, start=1)]),
        transmission=_build(Transmission, file.transmission, "[transmission]"),
        balls=_build(Balls, file.balls, "[balls]"),
        utilisation=_build(Utilisation, file.utilisation, "[utilisation]"),
        requirements=_build(Requirements, file.requirements, "[requirements]"),
        motor=_motor(file.motor),
        bearing_n_m=file.screw.bearing_n_m,
        nut_n_m=file.screw.nut_n_m,
        carried_kg=file.axis.carried_kg,
    )


def _motor(table: dict[str, Any] | None) -> Motor | None:
    if table is None:
        return None
    return _build(Motor, convert(table, MotorSection, "motor"), "[motor]")


def _mounting(screw: ScrewSection) -> Mounting:
    if screw.support not in SUPPORTS:
        raise unknown_name("[screw] support", screw.support, SUPPORTS)
    coefficients = {"whirl": screw.whirl_coefficient, "buckling": screw.buckling_coefficient}
    given = {name: value for name, value in coefficients.items() if value is not None}
    for name, value in given.items():
        check_range(
            f"[screw] {name}_coefficient", value, 1e-3, 1e4, "leave it out for the beam's own"
        )
    for name, value in (("bearing_n_m", screw.bearing_n_m), ("nut_n_m", screw.nut_n_m)):
        if value != math.inf:
            bounds.datum(f"[screw] {name}", value)
    with _prefix_errors("[screw]"):
        return Mounting(
            length_m=screw.length_m,
            support=SUPPORTS[screw.support]._replace(**given),
            free_length_m=screw.free_length_m,
            density_kg_m3=screw.density_kg_m3,
            youngs_modulus_pa=screw.youngs_modulus_pa,
            shear_modulus_pa=screw.shear_modulus_pa,
        )


def _load(axis: AxisSection) -> AxisLoad:
    check_range(
        "[axis] slope_deg", axis.slope_deg, -90.0, 90.0, "0 is horizontal, positive goes up"
    )
    bounds.datum("[axis] carried_kg", axis.carried_kg, zero=True)
    with _prefix_errors("[axis]"):
        return AxisLoad(
            mass_kg=axis.mass_kg,
            slope_rad=math.radians(axis.slope_deg),
            friction_coefficient=axis.friction_coefficient,
            force_n=axis.force_n,
        )


def _move(number: int, row: dict[str, Any]) -> Move:
    section = convert(row, CycleMoveSection, f"move.{number}")
    return _build(Move, section, f"[[move]] {number}:")


def _build(kind: Callable[..., T], section: Section, where: str) -> T:
    """Build an object of a section's keys; an error names the section."""
    with _prefix_errors(where):
        return kind(**msgspec.structs.asdict(section))


@contextmanager
def _prefix_errors(where: str) -> Iterator[None]:
    """Put the name of a section before the text of a PlanError."""
    try:
        yield
    except PlanError as error:
        raise PlanError(f"{where} {error}") from None


def _catalogue(rows: list[dict[str, Any]]) -> dict[str, CatalogueEntry]:
    entries: dict[str, CatalogueEntry] = {}
    for number, row in enumerate(rows, start=1):
        section = convert(row, EntrySection, f"catalogue.{number}")
        if section.name in entries:
            raise ConfigError(
                f"[[catalogue]] name = {section.name!r} twice; must be unique: rename one"
            )
        where = f"[[catalogue]] {section.name.strip() or number}:"
        entries[section.name] = _build(CatalogueEntry, section, where)
    return entries


def _shipped(name: str) -> dict[str, Any]:
    path = resources.files("rig.studies.sizing") / "screws" / f"{name}.toml"
    return tomllib.loads(path.read_text())
