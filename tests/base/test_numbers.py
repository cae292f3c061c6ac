"""Numbers as people and other programs write them."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.numbers import real, reals, whole

NEVER = (
    "", " ", "nan", "inf", "-Infinity", "1_000", "1e400", "\u0663", "\u00b2", "0x10", "1,5", "1.5.", "e5",
    "--1",
)  # fmt: skip


@pytest.mark.parametrize("text", [*NEVER, ".", "1e", "1 2"])
def test_what_only_python_reads_is_no_number(text: str) -> None:
    with pytest.raises(ValueError, match="is not a number"):
        real(text)


@pytest.mark.parametrize("text", [*NEVER, "1.0", "1e3", "9" * 5000])
def test_what_only_python_reads_is_no_whole_number(text: str) -> None:
    with pytest.raises(ValueError, match="is not a whole number"):
        whole(text)


def test_decimal_numbers_are_read() -> None:
    assert [real(each) for each in ("1", "-1.5", "+.5", "2.", "1e-3", "1E+5")] == [1, -1.5, 0.5, 2, 1e-3, 1e5]
    assert [whole(each) for each in ("0", "-12", "+007", "9" * 20)] == [0, -12, 7, 10**20 - 1]


def test_columns_of_files_have_no_underscores() -> None:
    assert reals([b"1.5", b"-2e3", b"nan"])[:2].tolist() == [1.5, -2000.0]
    assert np.isnan(reals([b"nan"])).all()
    with pytest.raises(ValueError, match="underscore"):
        reals([b"7", b"1_000"])
    with pytest.raises(ValueError):
        reals(["\u0663".encode()])
