"""Factory of the simulated elastic joint; the only import of sim_rig."""

from __future__ import annotations

from typing import Any

from rig.errors import ConfigError
from rig.run.toml_file import convert
from sim_rig.elastic_joint import ElasticJoint
from sim_rig.joint_params import Joint


def elastic_joint(tables: dict[str, Any], seed: int, section: str = "bench") -> ElasticJoint:
    """Build the simulated plant of a drive study from a section.

    Raises ConfigError naming section, key, value and bound.
    """
    try:
        return ElasticJoint(convert(tables, Joint, section), seed)
    except ValueError as error:
        raise ConfigError(str(error)) from None
