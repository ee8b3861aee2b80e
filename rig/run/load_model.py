"""The load as the planner models it: `[model]` in, planner model out."""

from __future__ import annotations

from planners.errors import PlanError
from planners.models.chain import ChainModel, parse_links
from planners.models.model import Model
from planners.models.pendulum import PendulumModel
from rig.errors import ConfigError
from rig.run.config import Experiment, ModelSection
from rig.run.units import CABLE, suspect

CHAIN_KEYS = ("stiffness_n_m_rad", "joint_damping_n_m_s_rad", "tip_mass_kg")  # need links


def planner_model(experiment: Experiment) -> Model:
    """Build the planner's model of an experiment's load; raises ConfigError naming the key."""
    if experiment.model.length_m is not None:
        suspect("[model] length_m =", experiment.model.length_m, CABLE)
    try:
        return build_model(experiment.model)
    except PlanError as error:
        raise ConfigError(f"[model] {error}") from error


def build_model(section: ModelSection) -> Model:
    """Build a cable pendulum, or a chain where the section has links. Raises PlanError."""
    common = {
        "damping_ratio": section.damping_ratio,
        "gravity_m_s2": section.gravity_m_s2,
        "cart_mass_kg": section.cart_mass_kg,
    }
    if not section.links:
        _check_cable(section)
        return PendulumModel(length_m=section.cable_m, mass_kg=section.mass_kg, **common)
    return ChainModel(
        links=parse_links(",".join(section.links)),
        stiffness_n_m_rad=tuple(section.stiffness_n_m_rad),
        joint_damping_n_m_s_rad=tuple(section.joint_damping_n_m_s_rad),
        tip_mass_kg=section.tip_mass_kg,
        **common,
    )


def _check_cable(section: ModelSection) -> None:
    """Refuse keys of a chain where no links are given."""
    for name in CHAIN_KEYS:
        value = getattr(section, name)
        if value:
            raise PlanError(
                f"{name} = {value} without links; a cable has none: give links, or leave it out"
            )
