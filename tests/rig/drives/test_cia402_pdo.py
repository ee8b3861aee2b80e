"""PDO mapping, transmission types and SYNC against CiA 301."""

import pytest

from tests.rig.drives.cia402_bench import MS, NodeBench, SdoRefused

TPDO3, RPDO3 = 0x385, 0x405
DISABLED = 1 << 31


def refused_code(bench, *args, **options):
    with pytest.raises(SdoRefused) as refused:
        bench.write(*args, **options)
    return refused.value.code


def configure(bench, communication, mapping, entries, kind=255, **parameters):
    """Configure a PDO in the order that CiA 301 prescribes."""
    cob_id = bench.read(communication, 1)
    bench.write(communication, cob_id | DISABLED, 1)
    bench.write(communication, kind, 2)
    for sub, value in parameters.items():
        bench.write(communication, value, int(sub[1:]))
    bench.write(mapping, 0)
    for sub, entry in enumerate(entries, start=1):
        bench.write(mapping, entry, sub)
    bench.write(mapping, len(entries))
    bench.write(communication, cob_id & ~DISABLED, 1)


def operational():
    bench = NodeBench()
    bench.nmt(1)
    return bench


def ids(frames):
    return [f.can_id for f in frames]


def test_the_default_mapping_is_that_of_cia_402():
    bench = NodeBench()
    rpdo = [
        [bench.read(0x1600 + n, s + 1) for s in range(bench.read(0x1600 + n))] for n in range(4)
    ]
    tpdo = [
        [bench.read(0x1A00 + n, s + 1) for s in range(bench.read(0x1A00 + n))] for n in range(4)
    ]
    control, status = 0x60400010, 0x60410010
    assert rpdo == [[control], [control, 0x60600008], [control, 0x607A0020], [control, 0x60FF0020]]
    assert tpdo == [[status], [status, 0x60610008], [status, 0x60640020], [status, 0x606C0020]]


def test_a_mapping_written_in_the_prescribed_order_is_used():
    bench = operational()
    configure(bench, 0x1802, 0x1A02, [0x60640020, 0x60770010, 0x60FD0020 & ~0x1F | 0x20][:2], 1)
    bench.position = -7.0
    bench.run(1)
    (frame,) = [f for f in bench.sync() if f.can_id == TPDO3]
    assert frame.data == (-7).to_bytes(4, "little", signed=True) + b"\0\0"


@pytest.mark.parametrize(
    ("index", "sub", "value"), [(0x1602, 0, 0), (0x1602, 1, 0x60400010), (0x1A02, 0, 0)]
)
def test_the_mapping_of_a_valid_pdo_cannot_change(index, sub, value):
    assert refused_code(NodeBench(), index, value, sub) == 0x08000022


def test_an_entry_cannot_change_while_the_count_is_not_0():
    bench = NodeBench()
    bench.write(0x1802, 0x385 | DISABLED, 1)
    assert refused_code(bench, 0x1A02, 0x60410010, 1) == 0x08000022


@pytest.mark.parametrize(
    ("mapping", "entry", "code"),
    [
        (0x1602, 0x50000010, 0x06020000),
        (0x1602, 0x60400110, 0x06090011),
        (0x1602, 0x60410010, 0x06040041),  # read-only in an RPDO
        (0x1602, 0x10170010, 0x06040041),  # not mappable
        (0x1602, 0x60400020, 0x06040041),  # wrong length
        (0x1A02, 0x00060010, 0x06020000),  # dummy in a TPDO
    ],
)
def test_an_object_that_does_not_fit_is_refused(mapping, entry, code):
    bench = NodeBench()
    communication = mapping - 0x200
    bench.write(communication, 0x385 | DISABLED, 1)
    bench.write(mapping, 0)
    assert refused_code(bench, mapping, entry, 1) == code


def test_a_pdo_of_more_than_8_bytes_is_too_long():
    bench = NodeBench()
    bench.write(0x1802, 0x385 | DISABLED, 1)
    bench.write(0x1A02, 0)
    for sub, entry in enumerate([0x60640020, 0x606C0020, 0x60610008], start=1):
        bench.write(0x1A02, entry, sub)
    assert refused_code(bench, 0x1A02, 3) == 0x06040042
    assert bench.read(0x1A02) == 0
    bench.write(0x1A02, 2)
    assert refused_code(bench, 0x1A02, 9) == 0x06090031


def test_a_count_beyond_the_written_entries_is_refused():
    bench = NodeBench()
    bench.write(0x1800, 0x185 | DISABLED, 1)
    bench.write(0x1A00, 0)
    assert refused_code(bench, 0x1A00, 2) == 0x06020000


@pytest.mark.parametrize(
    ("sub", "value", "code"),
    [
        (1, 0x387, 0x08000022),  # another CAN-ID while valid
        (1, 0x20000385, 0x06090030),  # extended frame
        (1, 0x581, 0x06090030),  # CAN-ID of the SDO
        (2, 241, 0x06090030),
        (2, 252, 0x06090030),
        (3, 10, 0x08000022),  # inhibit time while valid
    ],
)
def test_a_forbidden_communication_parameter_is_refused(sub, value, code):
    assert refused_code(NodeBench(), 0x1802, value, sub) == code


def test_a_disabled_pdo_may_take_another_can_id():
    bench = operational()
    bench.write(0x1802, 0x1B0 | DISABLED, 1)
    assert TPDO3 not in ids(bench.sync())
    bench.write(0x1802, 0x1B0, 1)
    assert 0x1B0 in ids(bench.sync())


def test_an_asynchronous_rpdo_acts_at_once():
    bench = operational()
    bench.run(1)
    bench.send(0x205, b"\x06\0")
    assert bench.node.state.name == "READY_TO_SWITCH_ON"


def test_a_synchronous_rpdo_acts_with_the_next_sync_and_the_last_one_counts():
    bench = operational()
    bench.send(RPDO3, b"\0\0" + (11).to_bytes(4, "little"))
    bench.send(RPDO3, b"\0\0" + (12).to_bytes(4, "little"))
    assert bench.read(0x607A) == 0
    bench.sync()
    assert bench.read(0x607A) == 12


def test_process_data_are_ignored_outside_of_operational():
    bench = NodeBench()
    bench.run(1)
    for command in (0x80, 0x02):
        bench.nmt(command)
        bench.send(0x205, b"\x06\0")
        assert bench.sync() == []
        assert bench.node.state.name == "SWITCH_ON_DISABLED"


def test_a_dummy_entry_skips_bytes():
    bench = operational()
    configure(bench, 0x1400, 0x1600, [0x00050008, 0x00060010, 0x60FF0020])
    bench.send(0x205, b"\xaa\xbb\xcc" + (-5).to_bytes(4, "little", signed=True))
    assert bench.read(0x60FF, signed=True) == -5


def test_a_mode_in_the_same_pdo_is_set_before_the_control_word():
    bench = operational()
    bench.run(1)
    bench.send(0x305, b"\x06\0\x08")
    assert (bench.read(0x6061), bench.node.state.name) == (8, "READY_TO_SWITCH_ON")


def test_a_target_behind_the_control_word_of_a_pdo_is_set_before_it():
    bench = operational()
    bench.enable(1)
    bench.write(0x1402, 255, 2)
    bench.send(RPDO3, b"\x1f\0" + (70).to_bytes(4, "little"))
    bench.run(1000)
    assert bench.read(0x6064) == 70


def test_a_pdo_that_is_too_short_is_ignored_and_reported_once_until_a_good_one_comes():
    bench = operational()
    bench.run(1)
    for _ in range(3):
        bench.send(0x305, b"\x06\0")
    bench.send(0x205, b"\x06\0")  # another PDO
    assert bench.emergencies() == [(0x8210, 0x11)]
    bench.send(0x305, b"\x06\0\0")
    assert bench.emergencies() == [(0x8210, 0x11), (0, 0)]
    assert bench.read(0x1003, 1) == 0x00028210


def test_a_pdo_that_is_too_long_is_used_up_to_its_length():
    bench = operational()
    bench.run(1)
    bench.send(0x205, b"\x06\0\xff\xff")
    assert bench.node.state.name == "READY_TO_SWITCH_ON"
    assert bench.emergencies() == []


def test_a_pdo_with_a_value_beyond_its_limits_is_ignored_as_a_whole():
    bench = operational()
    bench.run(1)
    bench.send(0x305, b"\x06\0\x07")
    assert bench.node.state.name == "SWITCH_ON_DISABLED"
    assert bench.emergencies() == [(0x8200, 0x11)]
    bench.send(0x305, b"\x06\0\x08")
    assert bench.emergencies()[-1] == (0, 0)


def test_event_pdos_are_sent_once_on_start_and_then_on_change():
    bench = NodeBench()
    assert ids(bench.nmt(1)) == [0x185, 0x285]
    assert bench.node.on_time(MS) == []
    bench.run(1)
    assert [f.data for f in bench.sent if f.can_id == 0x185][-1] == b"\x40\x02"


def test_the_status_word_of_a_control_word_is_sent_before_the_sdo_response():
    bench = operational()
    bench.run(1)
    bench.sent.clear()
    bench.command(0x06)
    assert ids(bench.sent) == [0x185, 0x285, 0x585]


def test_an_inhibit_time_delays_an_event_and_no_event_is_lost():
    bench = operational()
    configure(bench, 0x1802, 0x1A02, [0x60640020], 255, s3=100)  # 10 ms
    bench.sent.clear()
    times = []
    for k in range(25):
        bench.position = float(min(k, 12))
        before = len(bench.sent)
        bench.run(1)
        times += [k for f in bench.sent[before:] if f.can_id == TPDO3]
    assert times == [10, 20]
    assert bench.sent[-1].data == (12).to_bytes(4, "little")


def test_an_event_timer_repeats_a_pdo_without_change():
    bench = operational()
    configure(bench, 0x1800, 0x1A00, [0x60610008], 254, s5=7)
    bench.sent.clear()
    bench.run(22)
    assert ids(bench.sent).count(0x185) == 3


@pytest.mark.parametrize(("kind", "expected"), [(1, 12), (2, 6), (5, 2), (240, 0)])
def test_a_synchronous_pdo_is_sent_at_every_nth_sync(kind, expected):
    bench = operational()
    bench.write(0x1802, kind, 2)
    frames = [f for _ in range(12) for f in bench.sync()]
    assert ids(frames).count(TPDO3) == expected


def test_a_pdo_of_type_0_is_sent_at_the_sync_after_a_change():
    bench = operational()
    configure(bench, 0x1802, 0x1A02, [0x60640020], 0)
    assert ids(bench.sync()).count(TPDO3) == 1
    assert TPDO3 not in ids(bench.sync())
    bench.position = 3.0
    bench.run(1)
    assert TPDO3 not in ids(bench.sent[-3:])
    assert ids(bench.sync()).count(TPDO3) == 1


def test_a_remote_frame_is_answered_if_the_cob_id_allows_it():
    bench = operational()
    assert bench.send(0x185, is_remote=True) == []
    bench.write(0x1800, 0x185, 1)
    assert ids(bench.send(0x185, is_remote=True)) == [0x185]


def test_another_sync_cob_id_may_be_configured():
    bench = operational()
    bench.write(0x1005, 0x90)
    assert bench.sync() == []
    assert TPDO3 in ids(bench.send(0x090))


def test_a_reset_of_the_communication_restores_the_mapping():
    bench = operational()
    configure(bench, 0x1800, 0x1A00, [0x60610008])
    bench.nmt(0x82)
    bench.nmt(1)
    assert [len(f.data) for f in bench.sent if f.can_id == 0x185][-1] == 2
