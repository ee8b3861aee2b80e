"""A starved process is told from a silent peer, and named with what to do."""

from comms.channels import MS
from rig.run.runtime.starvation import Starvation
from rig.run.tasks.pause import PauseMeter

PERIOD_NS = 10 * MS


def meter_after(*instants_ms):
    """A pause meter that was ticked at these instants."""
    meter = PauseMeter(PERIOD_NS)
    for t_ms in instants_ms:
        meter.tick(t_ms * MS)
    return meter


def test_a_task_that_ticked_in_time_blames_its_peer():
    meter = meter_after(0, 10, 20, 31)
    assert meter.cause(103 * MS, "nothing arrived") == "nothing arrived"
    assert meter.note == ""


def test_a_task_that_was_not_run_says_for_how_long_and_what_to_do():
    meter = meter_after(0, 10, 133)
    assert "this process itself was not run for 113 ms" in meter.cause(120 * MS, "peer")
    assert "free it, or run with --virtual (`rig doctor` measures it)" in meter.cause(120 * MS, "")
    assert "was not run for 113 ms" in meter.note


def test_a_pause_that_explains_less_than_half_of_the_age_is_no_cause():
    assert meter_after(0, 10, 60).cause(100 * MS, "peer") == "peer"


def test_a_meter_without_two_ticks_knows_no_pause():
    assert meter_after().cause(100 * MS, "peer") == "peer"
    assert meter_after(500).note == ""


def test_starved_processes_are_named_worst_first_with_their_lateness():
    starvation = Starvation()
    starvation.add("bench", [0, 3 * MS, 105 * MS])
    starvation.add("bench", [1 * MS])
    starvation.add("vision", [49 * MS])
    starvation.add("operator", [300 * MS])
    (reason,) = starvation.reasons()
    assert reason.startswith("not run in time: 'operator' for 300 ms, 'bench' for 105 ms: ")
    assert "vision" not in reason


def test_a_machine_that_kept_up_is_no_reason():
    starvation = Starvation()
    starvation.add("bench", [2 * MS])
    starvation.add("vision", [])
    assert starvation.reasons() == []
