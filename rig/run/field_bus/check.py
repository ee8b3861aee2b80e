"""Checks of the field bus before a run: can the interface be opened, and is the node there."""

from __future__ import annotations

from canopen.sdo.exceptions import SdoAbortedError, SdoError

from comms.can_bus import AUTO, MULTICAST, CanSettings, CanUnavailable, chosen, open_bus
from comms.clock import new_run_clock
from rig.run.config import Experiment
from rig.run.field_bus.bus_choice import name_of
from rig.run.field_bus.exchange import BusFailed, Exchange, ObjectClient
from rig.run.finding import Finding

INTERFACE = "CAN interface"
ANSWER_S = 0.3  # longest wait for the node
DEVICE_TYPE = 0x1000


def check_field_bus(experiment: Experiment) -> list[Finding]:
    """Check the bus and the node of an experiment with a drive; takes about half a second."""
    section = experiment.can
    settings = chosen(
        CanSettings(interface=section.interface, channel=section.channel, bitrate=section.bitrate)
    )
    is_simulated = experiment.bench.kind == "simulated"
    node_id = experiment.node.node_id
    try:
        with open_bus(settings) as bus:
            findings = [Finding(INTERFACE, "ok", _interface_text(settings, section.interface))]
            if section.interface == AUTO:
                found = "simulated; on the bus once the run has started"
                return [*findings, Finding(f"node {node_id}", "ok", found)]
            exchange = Exchange(bus, new_run_clock())
            return [*findings, _node(exchange, node_id, is_simulated=is_simulated)]
    except (CanUnavailable, BusFailed) as error:
        return [Finding(INTERFACE, "failed", *_split(str(error)))]


def _interface_text(settings: CanSettings, asked: str) -> str:
    name = name_of(settings)
    if asked != AUTO:
        return f"{name} opened, {settings.bitrate} bit/s"
    way = "multicast" if settings.interface == MULTICAST else "unicast, as multicast is missing"
    return f"{way}: simulated bus on this machine ({settings.interface})"


def _node(exchange: Exchange, node_id: int, *, is_simulated: bool) -> Finding:
    """Ask the node for its device type."""
    name = f"node {node_id}"
    answers = _answers(exchange, node_id)
    if is_simulated and answers:
        advice = "two nodes would have this node-ID: change [drive] node_id, or take it off"
        return Finding(name, "failed", "answers, while the run simulates it", advice)
    if is_simulated:
        return Finding(name, "ok", "simulated; no other node has its node-ID")
    if answers:
        return Finding(name, "ok", "answers")
    advice = "look for power, termination, bit rate and [drive] node_id; `rig can scan` lists nodes"
    return Finding(name, "failed", f"no answer within {ANSWER_S:g} s", advice)


def _answers(exchange: Exchange, node_id: int) -> bool:
    try:
        ObjectClient(exchange, node_id, ANSWER_S).upload(DEVICE_TYPE, 0)
    except SdoAbortedError:  # a refusal is an answer
        return True
    except SdoError:
        return False
    return True


def _split(text: str) -> tuple[str, str]:
    found, _, advice = text.rpartition("; ")
    return found or text, advice if found else ""
