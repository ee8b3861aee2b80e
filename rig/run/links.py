"""The tables `[links.NAME]`: faults of the data channels, by the name of the channel."""

from __future__ import annotations

from typing import Any

from comms.channels import CHANNELS, DATA, RENAMED_CHANNELS, Transport
from comms.link import LinkFaults
from rig.errors import ConfigError
from rig.run.toml_file import convert, nearest, rename_key, rename_keys

SECTION = "links."


def rename(links: Any) -> None:
    """Give links of old names their new ones; raises ConfigError where both stand."""
    if isinstance(links, dict):
        rename_keys(links, RENAMED_CHANNELS, SECTION)


def renamed(assignment: str) -> str:
    """Give an override of an old name its new one."""
    return rename_key(assignment, RENAMED_CHANNELS, SECTION)


def check(links: Any) -> None:
    """Check that each link is a channel; what is not a table is left to the conversion.

    Raises ConfigError for another name and for a wrong key of a link.
    """
    if not isinstance(links, dict):
        return
    for name, faults in links.items():
        if name not in DATA:
            raise ConfigError(
                f"[links.{name}]: no such link{nearest(name, DATA)}; links: {', '.join(DATA)}"
            )
        found = convert(faults, LinkFaults, f"links.{name}")
        if found.corrupt and CHANNELS[name].transport is not Transport.CAN:
            raise ConfigError(
                f"[links.{name}] corrupt = {found.corrupt:g}; must be 0: only a field bus repeats "
                "a corrupted frame; here it is lost, take loss"
            )
