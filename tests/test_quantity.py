"""Lengths and times as a user writes them, and as they are shown."""

import math

import pytest

from hapticeval.errors import InputError
from hapticeval.quantity import format_duration, format_length, format_number, format_size, parse_duration, parse_length


@pytest.mark.parametrize(("text", "value"), [("0.1mm", 1e-4), ("50 um", 5e-5), ("1e-4m", 1e-4), ("3µm", 3e-6)])
def test_lengths(text, value):
    assert parse_length(text, option="--within") == pytest.approx(value)


@pytest.mark.parametrize(("text", "value"), [("10us", 1e-5), ("1 ms", 1e-3), ("500ns", 5e-7), ("2s", 2.0)])
def test_durations(text, value):
    assert parse_duration(text, option="--budget") == pytest.approx(value)


@pytest.mark.parametrize("text", ["0.1", "mm", "", "0.1 inch", "-1mm", "0mm", "nanmm", "1e999mm", "1.2.3mm", "10us"])
def test_what_is_no_length_is_refused_with_an_example(refused, text):
    with refused(InputError):
        parse_length(text, option="--within")


def test_the_unit_suits_the_size():
    assert [format_length(each) for each in (0.0, 1.2e-4, 3.1e-6, 9.9e-5, 2e-13)] == [
        "0",
        "0.12 mm",
        "3.1 µm",
        "99 µm",
        "0.2 pm",
    ]
    assert [format_length(each) for each in (0.0994, 0.0996, 0.397)] == ["99 mm", "100 mm", "397 mm"]
    assert [format_duration(each) for each in (2.0, 0.0024, 2.4e-6, 9e-8)] == ["2 s", "2.4 ms", "2.4 µs", "90 ns"]
    assert format_length(1e308) == "inf mm", "a file may hold any number"
    assert format_length(3.1e-6, micro="u") == "3.1 um"
    assert [format_size(each) for each in (12, 1_200, 1_234_567, 2_000_000_000)] == [
        "12 B",
        "1.2 kB",
        "1.23 MB",
        "2 GB",
    ]


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(109.3, 2, "110"), (-1234.0, 2, "-1200"), (99_999.0, 2, "100,000"), (1e5, 4, "100,000"), (8336.6, 4, "8337"),
     (1e6, 4, "1e6"), (1e-9, 4, "1e-9"), (0.000123, 2, "0.00012"), (0.0, 4, "0"), (-0.0, 4, "0"), (math.inf, 3, "inf")],
)  # fmt: skip
def test_a_number_has_no_power_of_ten_where_people_write_it_out(value, digits, text):
    assert format_number(value, digits) == text
    assert float(format_number(value, digits).replace(",", "")) == float(f"{value:.{digits}g}")
