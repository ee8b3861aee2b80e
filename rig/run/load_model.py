"""The load as the planner models it: `[model]` in, planner model out."""

from __future__ import annotations

from planners.errors import PlanError
from planners.models.chain import ChainModel, parse_links
from planners.models.model import Model
from planners.models.pendulum import PendulumModel
from rig.errors import ConfigError
from rig.run.config import Experiment, ModelSection


def load_model(experiment: Experiment) -> Model:
    """`[model]`: the load as the planner sees it. Raises ConfigError for one that cannot be."""
    try:
        return model_of(experiment.model)
    except PlanError as error:
        raise ConfigError(f"[model] {error}") from error


def model_of(m: ModelSection) -> Model:
    """A cable, or a chain where links are named. Raises PlanError."""
    common = {
        "damping_ratio": m.damping_ratio,
        "gravity_m_s2": m.gravity_m_s2,
        "cart_mass_kg": m.cart_mass_kg,
    }
    if not m.links:
        for name in ("stiffness_n_m_rad", "joint_damping_n_m_s_rad", "tip_mass_kg"):
            if getattr(m, name):
                raise PlanError(
                    f"{name} = {getattr(m, name)} without links; a cable has none: name links, or leave it out"
                )
        return PendulumModel(length_m=m.cable_m, mass_kg=m.mass_kg, **common)
    return ChainModel(
        links=parse_links(",".join(m.links)),
        stiffness_n_m_rad=tuple(m.stiffness_n_m_rad),
        joint_damping_n_m_s_rad=tuple(m.joint_damping_n_m_s_rad),
        tip_mass_kg=m.tip_mass_kg,
        **common,
    )
