"""The ledger of a run in virtual time: what the link model does to packets is counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from comms.link import LinkCount
from comms.records import LinkRow, Receipts
from rig.analysis.analyze import RunAnalysis
from rig.analysis.run_log import RunLog
from rig.run import config, experiment
from rig.run.runs import LOG

BRIEF = ["experiment.quiet_s=0.6", "experiment.watch_s=2.5", "safety.reference_stale_ms=5000"]
# policy and bounds that take late references in any order
TOLERANT = ["safety.angle_stale_ms=5000", "safety.robot_stale_ms=5000"]


def log_of(folder: Path, *changes: str) -> RunLog:
    """Log of the shipped move in virtual time."""
    chosen = config.read_experiment("move", [*BRIEF, *TOLERANT, *changes])
    ran = experiment.run(chosen, "virtual", folder, lambda *_: None, lambda *_: None)
    assert ran.outcome.exit_code == 0
    return RunLog.open(ran.folder / LOG)


def row(run: RunLog, channel: str) -> LinkCount:
    """Row of the ledger in the log."""
    (found,) = run.log.read(f"/link/{channel}", LinkRow)
    count: LinkCount = found.count
    return count


def outcomes(run: RunLog, channel: str) -> list[tuple[int, str]]:
    """Number and outcome of each packet, in the order of the arrivals."""
    records = run.log.read(f"/receipts/{channel}", Receipts)
    return [(seq, outcome) for record in records for seq, _, outcome in record.rows]


@pytest.mark.parametrize("channel", ["reference", "joint_state", "angle_1", "frame_1"])
def test_jitter_makes_packets_overtake_and_each_is_counted_as_superseded(
    tmp_path: Path, channel: str
) -> None:
    run = log_of(tmp_path, f"links.{channel}.jitter_ms=60")
    overtaken, newest = 0, -1
    for seq, outcome in outcomes(run, channel):
        assert outcome == ("superseded" if seq < newest else "")
        overtaken += seq < newest
        newest = max(newest, seq)
    count = row(run, channel)
    assert count.superseded == overtaken > 10
    assert count.delivered == len(outcomes(run, channel))
    assert (count.duplicated, count.rejected, count.unaccounted) == (0, {}, 0)


@pytest.mark.parametrize(
    "changes",
    [
        (),
        ("links.reference.loss=0.2", "links.reference.burst=4"),
        ("links.reference.loss=0.1", "links.reference.jitter_ms=40", "links.angle_1.loss=0.3"),
    ],
)
def test_sent_is_delivered_and_lost_on_every_link(tmp_path: Path, changes: tuple[str, ...]) -> None:
    links = log_of(tmp_path, *changes).links()
    assert len(links) == 8
    for link in links.values():
        count = link.count
        assert count.sent == count.delivered + count.lost_link
        assert (count.lost_kernel, count.lost_queue, count.foreign) == (0, 0, 0)
        assert count.superseded <= count.delivered
    lossless = {name for name, link in links.items() if link.count.lost_link == 0}
    lossy = {change.split(".")[1] for change in changes if ".loss=" in change}
    assert lossless == links.keys() - lossy


def test_without_jitter_no_packet_is_superseded(tmp_path: Path) -> None:
    links = log_of(tmp_path, "links.reference.delay_ms=25").links()
    assert {link.count.superseded for link in links.values()} == {0}


def test_the_summary_tells_the_superseded_packets_of_a_link(tmp_path: Path) -> None:
    run = log_of(tmp_path, "links.reference.jitter_ms=60")
    summary = RunAnalysis(run.folder / LOG).summary
    link = summary.links["reference"]
    assert link.superseded == row(run, "reference").superseded > 0
    assert (link.foreign, link.unexplained) == (0, 0)
