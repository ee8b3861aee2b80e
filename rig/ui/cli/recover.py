"""`rig recover`: a complete file from a truncated or damaged log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from comms.log_recovery import recover
from comms.log_scan import Recovery
from rig.errors import OK
from rig.run.runs import find_log
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_paragraph, print_written


def recover_log(
    name: Annotated[
        str,
        typer.Argument(
            metavar="BROKEN",
            help="Damaged .mcap file, run folder, part of a run's name, or `last`.",
            autocompletion=completion.recorded_runs,
        ),
    ],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="File to write, .mcap.")],
    as_json: AsJson = False,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> int:
    """Write the intact records of a damaged MCAP file to a complete one, and verify it."""
    found = recover(find_log(name, runs), target)
    if as_json:
        print_json({"file": str(target), "whole": found.is_whole, **msgspec.structs.asdict(found)})
        return OK
    print_written(target)
    print_paragraph(
        f"{found.messages} messages on {found.channels} channels, "
        f"{found.attachments} attachments, {found.metadata} metadata records; verified"
    )
    for line in _losses(found):
        print_paragraph(f"  left out: {line}", indent="    ")
    return OK


def _losses(found: Recovery) -> list[str]:
    counts = (
        (found.damaged_chunks, "damaged or cut chunks"),
        (found.damaged_attachments, "damaged attachments"),
        (found.unreadable_bytes, "bytes that are no record"),
        (found.messages_without_channel, "messages of a channel whose description is lost"),
    )
    return [f"{count} {what}" for count, what in counts if count]
