"""`rig can scan`: the nodes of a bus."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.errors import OK, RunFailed
from rig.ui.cli.can_options import Bitrate, Channel, ExperimentFile, Interface, Runs
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import counting, print_json
from rig.ui.cli.page import (
    Column,
    PageTable,
    err,
    plain_table,
    print_paragraph,
    print_table,
)

if TYPE_CHECKING:
    from rig.run.field_bus.scan import FoundNode

NODES = 127
COLUMNS = (
    "node",
    "NMT state",
    "name",
    Column("device type", drop=2),
    "vendor",
    "product",
    Column("revision", drop=1),
    "serial",
)


def scan(
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    timeout: Annotated[
        float, typer.Option(min=0.2, max=60, help="Longest wait for a first answer \\[s].")
    ] = 1.0,
    experiment: ExperimentFile = None,
    runs: Runs = Path("runs"),
    force: Annotated[
        bool,
        typer.Option("--force", help="Ask the nodes too, although a run uses the bus."),
    ] = False,
    as_json: AsJson = False,
) -> int:
    """List the CANopen nodes of a bus: state, identity and name.

    Each node-ID is asked by SDO, at most one a millisecond; on the bus of a running experiment
    nothing is sent. Exit code 3 where the bus cannot be opened, 5 where no node answers.
    """
    from comms.can_bus import open_bus
    from comms.clock import new_run_clock
    from rig.run.field_bus.bus_choice import BusOptions, choose_bus, run_on
    from rig.run.field_bus.exchange import Exchange
    from rig.run.field_bus.scan import Scanner

    choice = choose_bus(BusOptions(interface, channel, bitrate, experiment, runs))
    run = None if force else run_on(choice.settings, runs)
    with open_bus(choice.settings) as bus:
        scanner = Scanner(Exchange(bus, new_run_clock()))
        if run is not None:
            err.print(f"run {run.name} goes on on this bus: heartbeats alone; --force asks too")
            nodes = scanner.listen(timeout)
        else:
            what = f"asking the nodes of {choice.name}"
            with counting(what, NODES, quiet=as_json) as progress:
                nodes = scanner.run(timeout, progress)
    if not nodes:
        raise RunFailed(
            f"no node answered within {timeout:g} s on {choice.name}: look for power, termination "
            "and bit rate"
        )
    if as_json:
        print_json({"exit_status": "ok", "bus": choice.settings, "nodes": nodes})
        return OK
    _print_nodes(choice.name, nodes, is_asked=run is None)
    return OK


def _print_nodes(bus: str, nodes: Sequence[FoundNode], *, is_asked: bool) -> None:
    """Print the table, and what is strange about a node."""
    print_table(_table(bus, nodes))
    for node in nodes:
        if node.is_duplicated:
            print_paragraph(
                f"node {node.node_id}: more answers than requests; two nodes have this node-ID: "
                "change that of one of them",
                "yellow",
            )
        if is_asked and not node.answers_sdo:
            print_paragraph(
                f"node {node.node_id}: heartbeat alone, no answer by SDO: a stopped node, or a "
                "master",
                "dim",
            )


def _table(bus: str, nodes: Sequence[FoundNode]) -> PageTable:
    table = plain_table(f"nodes on {bus}", COLUMNS, left=3)
    for node in nodes:
        table.add_row(
            str(node.node_id),
            node.nmt_state or "no heartbeat",
            node.name or "-",
            _hexadecimal(node.device_type),
            _hexadecimal(node.vendor),
            _hexadecimal(node.product),
            _hexadecimal(node.revision),
            _hexadecimal(node.serial),
        )
    return table


def _hexadecimal(value: int | None) -> str:
    return "-" if value is None else f"{value:08X}"
