"""`rig can sdo`: reads and writes one object of a node."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.errors import OK, ConfigError, Refused
from rig.ui.cli.can_options import Bitrate, Channel, ExperimentFile, Interface, Runs
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import err, print_whole

if TYPE_CHECKING:
    from comms.can_bus import CanSettings
    from rig.run.field_bus.objects import ObjectValue

MAX_NODE_ID = 127


def sdo(
    node: Annotated[
        int, typer.Argument(metavar="NODE", min=1, max=MAX_NODE_ID, help="Node-ID, 1 to 127.")
    ],
    object_address: Annotated[
        str,
        typer.Argument(metavar="INDEX[:SUB]", help="Object in hexadecimal, e.g. 6064 or 1018:1."),
    ],
    value: Annotated[
        str | None, typer.Argument(metavar="VALUE", help="Value to write; without it, read.")
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            "--type",
            help="Data type, u8 to u64, i8 to i64, f32, f64, str or hex; that of the EDS file of "
            "this program by default.",
        ),
    ] = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    timeout: Annotated[
        float, typer.Option(min=0.01, max=60, help="Longest wait for an answer \\[s].")
    ] = 0.5,
    experiment: ExperimentFile = None,
    runs: Runs = Path("runs"),
    force: Annotated[
        bool, typer.Option("--force", help="Write to a bus although a run uses it.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Read an object of a node by SDO, or write it.

    Exit code 3 where the node refuses, or a run uses the bus; 5 where the node does not answer.
    """
    from comms.can_bus import open_bus
    from comms.clock import new_run_clock
    from rig.run.field_bus import objects
    from rig.run.field_bus.bus_choice import BusOptions, choose_bus
    from rig.run.field_bus.exchange import Exchange, ObjectClient

    if value is not None and value.startswith("--"):
        raise ConfigError(f"{value}: no such option; `rig can sdo --help` lists them")
    address = objects.parse_address(object_address)
    if kind is not None:
        objects.check_type(kind)
    choice = choose_bus(BusOptions(interface, channel, bitrate, experiment, runs))
    _respect_run(choice.settings, runs, may_send=value is None or force)
    with open_bus(choice.settings) as bus:
        client = ObjectClient(Exchange(bus, new_run_clock()), node, timeout)
        if value is None:
            got = objects.read_object(client, address, kind)
        else:
            got = objects.write_object(client, address, value, kind)
    entry = objects.known_entry(node, address)
    name = entry.name if entry is not None else ""
    if as_json:
        head = {"exit_status": "ok", "node": node, "object": address.name, "name": name}
        print_json(head | _document(got, is_written=value is not None))
        return OK
    verb = "=" if value is None else ":="
    words = (address.name, name, verb, got.text)
    print_whole(" ".join(word for word in words if word))
    return OK


def _document(got: ObjectValue, *, is_written: bool) -> dict[str, Any]:
    return {
        "is_written": is_written,
        "type": got.kind,
        "value": got.value,
        "data": got.data.hex(),
    }


def _respect_run(settings: CanSettings, runs: Path, *, may_send: bool) -> None:
    """Refuse a write to the bus of a running experiment; note a request of its own."""
    from rig.run.field_bus.bus_choice import run_on

    run = run_on(settings, runs)
    if run is None:
        return
    if not may_send:
        raise Refused(
            f"run {run.name} goes on on this bus; nothing was written: "
            "stop it with `rig stop`, or add --force"
        )
    err.print(
        f"run {run.name} goes on on this bus: its ledger shows the request as a packet of "
        "can_down that it did not send"
    )
