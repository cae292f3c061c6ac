"""Counts in messages."""

from addon.core.base.counting import counted, ordinal
from addon.core.media.clip import describe


def test_one_is_singular() -> None:
    assert [counted(n, "point") for n in (0, 1, 2)] == ["0 points", "1 point", "2 points"]
    assert (describe((4,)), describe((4, 5, 9))) == ("frame 4", "frames 4 to 9 with 3 missing")
    assert describe((1, 3, 5)) == "every 2nd frame from 1 to 5"


def test_ordinals() -> None:
    assert [ordinal(n) for n in (1, 2, 3, 4, 11, 12, 13, 21, 102, 112)] == [
        "1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "102nd", "112th",
    ]  # fmt: skip
