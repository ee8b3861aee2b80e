"""Object dictionary and EDS file against the tables of CiA 301 and CiA 402."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.cia402.eds import parse_eds
from rig.drives.cia402.errors import Cia402Error, SdoAbort
from rig.drives.cia402.object_dictionary import ObjectDictionary
from tests.rig.drives.cia402_bench import NodeBench, SdoRefused

I8, I16, I32, U8, U16, U32, STRING = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x09

# index, sub-index: data type, access, mappable into a PDO; from the standards
STANDARD = {
    (0x1000, 0): (U32, "ro", False),
    (0x1001, 0): (U8, "ro", True),
    (0x1003, 0): (U8, "rw", False),
    (0x1003, 1): (U32, "ro", False),
    (0x1005, 0): (U32, "rw", False),
    (0x1006, 0): (U32, "rw", False),
    (0x1008, 0): (STRING, "const", False),
    (0x1009, 0): (STRING, "const", False),
    (0x100A, 0): (STRING, "const", False),
    (0x1014, 0): (U32, "rw", False),
    (0x1016, 1): (U32, "rw", False),
    (0x1017, 0): (U16, "rw", False),
    (0x1018, 1): (U32, "ro", False),
    (0x1018, 4): (U32, "ro", False),
    (0x1029, 1): (U8, "rw", False),
    (0x1200, 1): (U32, "ro", False),
    (0x6007, 0): (I16, "rw", False),
    (0x603F, 0): (U16, "ro", True),
    (0x6040, 0): (U16, "rw", True),
    (0x6041, 0): (U16, "ro", True),
    (0x605A, 0): (I16, "rw", False),
    (0x605E, 0): (I16, "rw", False),
    (0x6060, 0): (I8, "rw", True),
    (0x6061, 0): (I8, "ro", True),
    (0x6064, 0): (I32, "ro", True),
    (0x6065, 0): (U32, "rw", True),
    (0x6066, 0): (U16, "rw", True),
    (0x606C, 0): (I32, "ro", True),
    (0x6071, 0): (I16, "rw", True),
    (0x6072, 0): (U16, "rw", True),
    (0x6077, 0): (I16, "ro", True),
    (0x607A, 0): (I32, "rw", True),
    (0x607C, 0): (I32, "rw", False),
    (0x607D, 1): (I32, "rw", False),
    (0x607D, 2): (I32, "rw", False),
    (0x607F, 0): (U32, "rw", True),
    (0x6080, 0): (U32, "rw", True),
    (0x6081, 0): (U32, "rw", True),
    (0x6083, 0): (U32, "rw", True),
    (0x6084, 0): (U32, "rw", True),
    (0x6085, 0): (U32, "rw", True),
    (0x6098, 0): (I8, "rw", True),
    (0x6099, 1): (U32, "rw", True),
    (0x6099, 2): (U32, "rw", True),
    (0x609A, 0): (U32, "rw", True),
    (0x60B0, 0): (I32, "rw", True),
    (0x60B1, 0): (I32, "rw", True),
    (0x60B2, 0): (I16, "rw", True),
    (0x60C1, 1): (I32, "rw", True),
    (0x60C2, 1): (U8, "rw", False),
    (0x60C2, 2): (I8, "rw", False),
    (0x60F4, 0): (I32, "ro", True),
    (0x60FD, 0): (U32, "ro", True),
    (0x60FF, 0): (I32, "rw", True),
    (0x6502, 0): (U32, "ro", False),
}
SIZES = {I8: 1, I16: 2, I32: 4, U8: 1, U16: 2, U32: 4}


@pytest.mark.parametrize("key", STANDARD, ids=lambda key: f"{key[0]:04X}:{key[1]}")
def test_an_entry_of_the_eds_file_is_that_of_the_standard(key):
    entry = ObjectDictionary(1).entry(*key)
    assert (entry.data_type, entry.access, entry.is_mappable) == STANDARD[key]


def test_the_dictionary_holds_four_pdos_of_each_direction():
    dictionary = ObjectDictionary(1)
    for number in range(4):
        for base in (0x1400, 0x1800):
            assert dictionary.entry(base + number, 2).data_type == U8
        for base in (0x1600, 0x1A00):
            assert dictionary.entry(base + number, 8).data_type == U32


def test_every_default_lies_within_the_limits_and_the_type_of_its_entry():
    for entry in ObjectDictionary(7).entries():
        if entry.length is None:
            continue
        low = entry.default if entry.low is None else entry.low
        high = entry.default if entry.high is None else entry.high
        assert low <= entry.default <= high, entry
        entry.default.to_bytes(entry.length, "little", signed=entry.data_type in (I8, I16, I32))


def test_every_array_states_its_highest_sub_index():
    dictionary = ObjectDictionary(1)
    highest = {}
    for entry in dictionary.entries():
        highest[entry.index] = entry.subindex
    counted = {0x1003, *range(0x1600, 0x1604), *range(0x1A00, 0x1A04)}  # sub-index 0 varies
    for index, last in highest.items():
        if last and index not in counted:
            assert dictionary.get(index) == last, hex(index)


@pytest.mark.parametrize("node_id", [1, 5, 127])
def test_cob_ids_follow_the_node_id(node_id):
    dictionary = ObjectDictionary(node_id)
    assert dictionary.get(0x1014) == 0x080 + node_id
    assert dictionary.get(0x1200, 1) == 0x600 + node_id
    assert dictionary.get(0x1402, 1) == 0x400 + node_id
    assert dictionary.get(0x1803, 1) & 0x7FF == 0x480 + node_id


@pytest.mark.parametrize("node_id", [0, 128, -1])
def test_a_node_id_out_of_range_is_refused(node_id):
    with pytest.raises(Cia402Error, match=f"node_id = {node_id}; must be 1 to 127"):
        ObjectDictionary(node_id)


def test_two_dictionaries_share_no_values():
    first, second = ObjectDictionary(1), ObjectDictionary(1)
    first.write(0x6081, 0, (77).to_bytes(4, "little"))
    assert (first.get(0x6081), second.get(0x6081)) == (77, 10000)
    assert parse_eds(1)[0x6081, 0].default == 10000


@pytest.mark.parametrize(
    ("index", "sub", "data", "code"),
    [
        (0x2001, 0, b"\0", 0x06020000),
        (0x6099, 3, b"\0", 0x06090011),
        (0x6041, 0, b"\0\0", 0x06010002),
        (0x1008, 0, b"abc", 0x06010002),
        (0x6040, 0, b"\0\0\0", 0x06070012),
        (0x6040, 0, b"\0", 0x06070013),
        (0x6081, 0, b"\0\0\0\0", 0x06090032),
        (0x605A, 0, b"\7\0", 0x06090031),
        (0x605A, 0, b"\xff\xff", 0x06090032),
        (0x6060, 0, b"\3", 0x06090030),
        (0x6098, 0, b"\1", 0x06090030),
        (0x1003, 0, b"\1", 0x06090030),
        (0x1005, 0, b"\x80\0\0\x40", 0x06090030),
        (0x1014, 0, b"\0\0\0\0", 0x06090030),
        (0x60C2, 2, b"\0", 0x06090031),
    ],
)
def test_a_forbidden_write_is_refused_with_its_abort_code_and_changes_nothing(
    index, sub, data, code
):
    bench = NodeBench()
    before = dict(bench.node.dictionary._values)
    with pytest.raises(SdoRefused) as refused:
        bench.download(index, sub, data)
    assert refused.value.code == code
    assert bench.node.dictionary._values == before


@pytest.mark.parametrize(
    ("index", "sub", "code"),
    [(0x5FFF, 0, 0x06020000), (0x1018, 5, 0x06090011), (0x1003, 1, 0x08000024)],
)
def test_a_forbidden_read_is_refused_with_its_abort_code(index, sub, code):
    with pytest.raises(SdoRefused) as refused:
        NodeBench().upload(index, sub)
    assert refused.value.code == code


def test_a_write_only_object_cannot_be_read(monkeypatch):
    dictionary = ObjectDictionary(3)
    entry = dictionary.entry(0x6040)
    hidden = {(0x6040, 0): type(entry)(**{n: getattr(entry, n) for n in entry.__slots__})}
    object.__setattr__(hidden[0x6040, 0], "access", "wo")
    monkeypatch.setattr(dictionary, "_entries", hidden)
    with pytest.raises(SdoAbort, match="0x06010001"):
        dictionary.read(0x6040)


def test_an_error_names_object_value_bound_and_next_step():
    dictionary = ObjectDictionary(3)
    with pytest.raises(SdoAbort, match=r"605A:00.*0x06090031.*7, must be 0 to 6: see the limits"):
        dictionary.write(0x605A, 0, b"\7\0")


@given(data=st.data())
def test_every_integer_in_range_survives_write_and_read(data):
    dictionary = ObjectDictionary(9)
    free = [(i, s) for (i, s), (t, a, _) in STANDARD.items() if a == "rw" and i >= 0x6061]
    index, sub = data.draw(st.sampled_from([k for k in free if k[0] != 0x6098]))
    entry = dictionary.entry(index, sub)
    size = SIZES[entry.data_type]
    signed = entry.data_type in (I8, I16, I32)
    low = -(1 << 8 * size - 1) if signed else 0
    high = low + (1 << 8 * size) - 1
    low = low if entry.low is None else entry.low
    high = high if entry.high is None else entry.high
    value = data.draw(st.integers(low, high))
    dictionary.write(index, sub, value.to_bytes(size, "little", signed=signed))
    assert dictionary.get(index, sub) == value
    assert int.from_bytes(dictionary.read(index, sub), "little", signed=signed) == value


def test_the_device_cannot_store_a_value_beyond_its_type():
    dictionary = ObjectDictionary(3)
    dictionary.set(0x6064, 2**40)
    assert dictionary.read(0x6064) == b"\xff\xff\xff\x7f"
    dictionary.set(0x6077, -(2**20))
    assert dictionary.read(0x6077) == b"\x00\x80"


def test_a_reset_of_the_communication_area_keeps_the_profile():
    dictionary = ObjectDictionary(3)
    dictionary.write(0x1017, 0, b"\x64\0")
    dictionary.write(0x6066, 0, b"\x64\0")
    dictionary.reset((0x1000, 0x1FFF))
    assert (dictionary.get(0x1017), dictionary.get(0x6066)) == (0, 100)
    dictionary.reset()
    assert dictionary.get(0x6066) == 0
