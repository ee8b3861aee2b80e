"""First rows of five records of other laboratories, read as their authors meant them."""

import math
from pathlib import Path

import numpy as np
import pytest

from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions

DATA = Path(__file__).parent / "data"


@pytest.mark.parametrize(
    ("name", "first_deg"), [("swing_degrees_a.txt", -90.36), ("swing_degrees_b.txt", -135.27)]
)
def test_one_column_of_degrees_takes_rate_and_unit_from_the_lines_above(name, first_deg):
    record = read_signal(DATA / name)
    assert record.values[0] == pytest.approx(math.radians(first_deg))
    assert record.values.size == 60
    assert record.unit == "rad"
    assert "trigger_start_deg" in record.unit_source
    assert record.rate_hz == pytest.approx(1000)
    assert "sample_rate" in record.time_source
    assert record.t_s[0] == 0.0


def test_an_encoder_shows_its_quantum():
    record = read_signal(DATA / "swing_degrees_a.txt")
    quanta = math.degrees(record.quantum) / 0.09  # of an encoder with 4000 lines
    assert quanta == pytest.approx(round(quanta), abs=0.12)
    assert 1 <= round(quanta) <= 3


@pytest.mark.parametrize(
    ("name", "first_v"), [("slow_decay_a.txt", -0.009), ("slow_decay_b.txt", 0.132)]
)
def test_an_export_of_a_school_logger_is_volts_at_10_hz(name, first_v):
    record = read_signal(DATA / name)
    assert record.values[0] == first_v
    assert record.unit == "V"
    assert record.unit_source == "header 'Voltage ( V )'"
    assert record.rate_hz == pytest.approx(10)
    assert record.layout == "tab, numbers from line 3"
    assert record.findings == ()


def test_a_phone_gives_rates_of_turn_and_lists_the_other_columns():
    record = read_signal(DATA / "hand_motion.csv")
    assert record.unit == "rad/s"
    assert record.rate_hz == pytest.approx(99.6, abs=0.1)
    assert len(record.columns) == 5
    assert record.count("other_columns") == 2  # the magnitude is no candidate


def test_a_column_is_chosen_by_number_and_by_name():
    by_number = read_signal(DATA / "hand_motion.csv", ReadOptions(signal="2"))
    by_name = read_signal(DATA / "hand_motion.csv", ReadOptions(signal="gyroscope x"))
    assert by_number.values[0] == 4.023174345e-1
    assert np.array_equal(by_number.values, by_name.values)
