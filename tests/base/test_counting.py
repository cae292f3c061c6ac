"""Counts in messages."""

from addon.core.base.counting import counted
from addon.core.media.clip import describe


def test_one_is_singular() -> None:
    assert [counted(n, "point") for n in (0, 1, 2)] == ["0 points", "1 point", "2 points"]
    assert counted(1, "vertex", "vertices") == "1 vertex"
    assert counted(3, "vertex", "vertices") == "3 vertices"
    assert (describe((4,)), describe((4, 5, 9))) == ("frame 4", "frames 4 to 9 with 3 missing")
