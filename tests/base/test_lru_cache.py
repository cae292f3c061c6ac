"""Values that are remembered by their arguments."""

from __future__ import annotations

from dataclasses import dataclass, field

from addon.core.base.lru_cache import LRUCache, remembered


@dataclass(frozen=True)
class Doubled:
    calls: list[int] = field(default_factory=list)

    @remembered(2)
    def of(self, value: int, times: int = 2) -> int:
        self.calls.append(value)
        return times * value


def test_the_last_results_of_a_method_are_remembered_by_its_arguments() -> None:
    one, other = Doubled(), Doubled()
    assert [one.of(each) for each in (1, 2, 1, 3, 1, 2)] == [2, 4, 2, 6, 2, 4]
    assert one.calls == [1, 2, 3, 2] and one.of(2, times=3) == 6
    # Each object has its own.
    assert other.of(1) == 2 and other.calls == [1]


def test_values_are_dropped_by_their_size_but_for_the_last() -> None:
    cache = LRUCache[str](4, len)
    for each in ("aa", "bb", "cc"):
        cache.get(each, each.upper)
    assert [each in cache for each in ("aa", "bb", "cc")] == [False, True, True]
    assert cache.get("larger", lambda: "LARGER") == "LARGER" and "cc" not in cache and "larger" in cache
