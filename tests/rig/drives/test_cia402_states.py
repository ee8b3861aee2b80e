"""Drive state machine against the tables of CiA 402, written here from the standard."""

import pytest

from rig.drives.cia402.state_machine import (
    TRANSITIONS,
    DriveState,
    compose_status_word,
    decode_control_word,
)
from tests.rig.drives.cia402_bench import MS, NodeBench

# bits 6, 5, 3, 2, 1 and 0 of the status word; None = either value
STATUS_TABLE = {
    "NOT_READY_TO_SWITCH_ON": "0x0000",
    "SWITCH_ON_DISABLED": "1x0000",
    "READY_TO_SWITCH_ON": "010001",
    "SWITCHED_ON": "010011",
    "OPERATION_ENABLED": "010111",
    "QUICK_STOP_ACTIVE": "000111",
    "FAULT_REACTION_ACTIVE": "0x1111",
    "FAULT": "0x1000",
}
STATUS_BITS = (6, 5, 3, 2, 1, 0)
VOLTAGE_ENABLED = 1 << 4
REMOTE = 1 << 9

# bits 7, 3, 2, 1 and 0 of the control word
COMMAND_TABLE = {
    "shutdown": "0x110",
    "switch on": "00111",
    "enable operation": "01111",
    "disable voltage": "0xx0x",
    "quick stop": "0x01x",
    "fault reset": "1xxxx",  # rising edge
}
COMMAND_BITS = (7, 3, 2, 1, 0)

# state: command: (transitions, next state); all others change nothing
COMMANDED = {
    "SWITCH_ON_DISABLED": {"shutdown": ([2], "READY_TO_SWITCH_ON")},
    "READY_TO_SWITCH_ON": {
        "switch on": ([3], "SWITCHED_ON"),
        "enable operation": ([3, 4], "OPERATION_ENABLED"),
        "disable voltage": ([7], "SWITCH_ON_DISABLED"),
        "quick stop": ([7], "SWITCH_ON_DISABLED"),
    },
    "SWITCHED_ON": {
        "shutdown": ([6], "READY_TO_SWITCH_ON"),
        "enable operation": ([4], "OPERATION_ENABLED"),
        "disable voltage": ([10], "SWITCH_ON_DISABLED"),
        "quick stop": ([10], "SWITCH_ON_DISABLED"),
    },
    "OPERATION_ENABLED": {
        "shutdown": ([8], "READY_TO_SWITCH_ON"),
        "switch on": ([5], "SWITCHED_ON"),
        "disable voltage": ([9], "SWITCH_ON_DISABLED"),
        "quick stop": ([11], "QUICK_STOP_ACTIVE"),
    },
    "QUICK_STOP_ACTIVE": {
        "enable operation": ([16], "OPERATION_ENABLED"),
        "disable voltage": ([12], "SWITCH_ON_DISABLED"),
    },
    "FAULT": {"fault reset": ([15], "SWITCH_ON_DISABLED")},
}
# state, event inside the drive: transitions and next state
AUTOMATIC = {
    (0, None, "NOT_READY_TO_SWITCH_ON"),
    (1, "NOT_READY_TO_SWITCH_ON", "SWITCH_ON_DISABLED"),
    (12, "QUICK_STOP_ACTIVE", "SWITCH_ON_DISABLED"),
    (14, "FAULT_REACTION_ACTIVE", "FAULT"),
    *((13, name, "FAULT_REACTION_ACTIVE") for name in list(STATUS_TABLE)[:6]),
}
VELOCITY_MODE = 9


def matches(pattern, bits, word):
    """True if the bits of a word agree with a pattern of 0, 1 and x."""
    return all(
        digit == "x" or int(digit) == word >> bit & 1
        for digit, bit in zip(pattern, bits, strict=True)
    )


def command_of(word):
    """Command of a control word after one with bit 7 clear."""
    names = [name for name, p in COMMAND_TABLE.items() if matches(p, COMMAND_BITS, word)]
    assert len(names) == 1
    return names[0]


def moving(quick_stop_option=6):
    """Bench with a moving axis whose quick stop lasts long."""
    bench = NodeBench(positive_end=1000.0).enable(VELOCITY_MODE)
    bench.write(0x605A, quick_stop_option)
    bench.write(0x6085, 10)
    bench.write(0x606F, 50)
    bench.write(0x60FF, 1000)
    bench.run(20)
    return bench


def bench_in(state, quick_stop_option=6):
    """Bench in a state of the drive, with bit 7 of the last control word clear."""
    if state == "NOT_READY_TO_SWITCH_ON":
        return NodeBench()
    if state == "QUICK_STOP_ACTIVE":
        bench = moving(quick_stop_option)
        bench.command(0x02)
    elif state == "FAULT_REACTION_ACTIVE":
        bench = moving()
        bench.position = 1000.0
    else:
        bench = NodeBench()
    words = {
        "READY_TO_SWITCH_ON": (6,),
        "SWITCHED_ON": (6, 7),
        "OPERATION_ENABLED": (6, 7, 15),
    }
    bench.drive_fault = 0x2310 if state == "FAULT" else 0
    bench.run(1)
    bench.drive_fault = 0
    bench.run(1)
    bench.command(*words.get(state, ()))
    assert bench.node.state.name == state
    return bench


@pytest.mark.parametrize("state", STATUS_TABLE)
def test_the_status_word_of_a_state_has_the_bits_of_the_standard(state):
    word = bench_in(state).status
    names = [name for name, p in STATUS_TABLE.items() if matches(p, STATUS_BITS, word)]
    assert names == [state]
    powered = ("SWITCHED_ON", "OPERATION_ENABLED", "QUICK_STOP_ACTIVE", "FAULT_REACTION_ACTIVE")
    assert bool(word & VOLTAGE_ENABLED) == (state in powered)
    assert bool(word & REMOTE) == (state != "NOT_READY_TO_SWITCH_ON")


@pytest.mark.parametrize("state", DriveState, ids=lambda state: state.name)
def test_the_bits_of_a_mode_change_no_bit_of_the_state(state):
    word = compose_status_word(state, 0x3C00)
    assert word & 0x3C00 == 0x3C00
    assert matches(STATUS_TABLE[state.name], STATUS_BITS, word)


def test_every_control_word_decodes_to_the_command_of_the_standard():
    for word in range(0x10000):
        event = decode_control_word(word, 0)
        assert event is not None
        assert event.value == command_of(word)


def test_fault_reset_is_a_rising_edge_and_no_other_command_passes_with_it():
    for word in range(0x80, 0x100):
        assert decode_control_word(word, 0x80) is None


def test_the_transition_table_is_that_of_the_standard():
    names = {None: None, **{state: state.name for state in DriveState}}
    rows = {(row.number, names[row.source], names[row.target]) for row in TRANSITIONS}
    expected = set(AUTOMATIC)
    for source, commands in COMMANDED.items():
        for numbers, target in commands.values():
            if numbers == [3, 4]:
                expected.add((3, source, "SWITCHED_ON"))
            else:
                expected.add((numbers[0], source, target))
    assert rows == expected
    assert {number for number, _, _ in rows} == set(range(17))


@pytest.mark.parametrize("state", STATUS_TABLE)
def test_every_control_word_in_a_state_leads_where_the_standard_says_or_changes_nothing(state):
    for word in range(0x100):
        bench = bench_in(state)
        before = bench.status
        bench.command(word)
        _, target = COMMANDED.get(state, {}).get(command_of(word), ([], state))
        assert bench.node.state.name == target, f"0x{word:02X}"
        if target == state and state != "OPERATION_ENABLED":
            assert bench.status == before


@pytest.mark.parametrize("option", [1, 2])
def test_enable_operation_does_not_end_a_quick_stop_that_switches_off(option):
    bench = bench_in("QUICK_STOP_ACTIVE", option)
    bench.command(0x0F)
    assert bench.node.state.name == "QUICK_STOP_ACTIVE"


@pytest.mark.parametrize("state", list(STATUS_TABLE)[:6])
def test_a_fault_of_the_power_stage_leads_from_every_state_to_fault_within_one_step(state):
    bench = bench_in(state)
    bench.drive_fault = 0x3210
    (demand,) = bench.run(1)
    assert bench.node.state.name == "FAULT"
    assert demand.kind == "off"
    assert bench.read(0x603F) == 0x3210
    assert bench.emergencies()[-1] == (0x3210, 0x05)


def test_a_fault_reset_while_the_fault_persists_changes_nothing():
    bench = NodeBench()
    bench.drive_fault = 0x2310
    bench.run(1)
    bench.command(0x80)
    assert bench.node.state.name == "FAULT"
    bench.drive_fault = 0
    bench.run(1)
    assert bench.node.state.name == "FAULT"
    bench.command(0x80)
    assert bench.node.state.name == "FAULT"  # no edge
    bench.command(0x00, 0x80)
    assert bench.node.state.name == "SWITCH_ON_DISABLED"
    assert bench.read(0x603F) == 0
    assert bench.read(0x1001) == 0


def test_a_fault_of_the_power_stage_during_the_reaction_switches_off_at_once():
    bench = bench_in("FAULT_REACTION_ACTIVE")
    bench.drive_fault = 0x2310
    assert bench.run(1)[0].kind == "off"
    assert bench.node.state.name == "FAULT"
    assert bench.read(0x603F) == 0x8612  # the first fault
    assert [code for code, _ in bench.emergencies()] == [0x8612, 0x2310]


def test_a_second_fault_does_not_end_the_reaction_to_the_first():
    bench = bench_in("FAULT_REACTION_ACTIVE")
    bench.write(0x1016, 0x7F << 16 | 10, 1)
    bench.send(0x77F, b"\x05")
    bench.run(15)
    assert (0x8130, 0x31) in bench.emergencies()
    assert bench.node.state.name == "FAULT_REACTION_ACTIVE"


def test_a_fault_reaction_ends_in_fault_with_the_power_off():
    bench = moving()
    bench.write(0x6085, 100_000)
    bench.position = 1000.0
    demands = bench.run(15)
    assert [d.kind for d in demands] == ["velocity"] * 9 + ["brake"] + ["off"] * 5
    assert bench.node.state.name == "FAULT"


@pytest.mark.parametrize(
    ("option", "samples", "end"),
    [
        (0, 0, "SWITCH_ON_DISABLED"),
        (1, 19, "SWITCH_ON_DISABLED"),
        (2, 9, "SWITCH_ON_DISABLED"),
        (5, 19, "QUICK_STOP_ACTIVE"),
        (6, 9, "QUICK_STOP_ACTIVE"),
    ],
)
def test_a_quick_stop_follows_its_option_code(option, samples, end):
    bench = moving(option)
    bench.write(0x6084, 50_000)
    bench.write(0x6085, 100_000)
    bench.command(0x02)
    demands = bench.run(30)
    assert [d.kind for d in demands].count("velocity") == samples
    assert bench.node.state.name == end
    assert demands[-1].kind == ("brake" if end == "QUICK_STOP_ACTIVE" else "off")


@pytest.mark.parametrize(("option", "samples"), [(0, 0), (1, 19), (2, 9)])
def test_a_fault_reaction_follows_its_option_code(option, samples):
    bench = moving()
    bench.write(0x605E, option)
    bench.write(0x6084, 50_000)
    bench.write(0x6085, 100_000)
    bench.position = 1000.0
    demands = bench.run(30)
    assert [d.kind for d in demands].count("velocity") == samples
    assert bench.node.state.name == "FAULT"


def test_an_axis_that_does_not_come_to_rest_is_switched_off_after_the_threshold_time():
    bench = moving(2)
    bench.write(0x6085, 1_000_000)
    bench.write(0x6070, 50)
    bench.command(0x02)
    bench.velocity = 5000.0  # that the encoder reports
    states = []
    for _ in range(52):
        bench.node.step(bench.t_ns, bench.feedback())
        bench.t_ns += MS
        states.append(bench.node.state.name)
    assert states == ["QUICK_STOP_ACTIVE"] * 50 + ["SWITCH_ON_DISABLED"] * 2


def test_a_reset_of_the_node_leads_to_the_state_after_power_on():
    bench = bench_in("OPERATION_ENABLED")
    bench.nmt(0x81)
    assert bench.node.state.name == "NOT_READY_TO_SWITCH_ON"
    bench.run(1)
    assert bench.node.state.name == "SWITCH_ON_DISABLED"
