"""Progress and cancellation of long work: a cancel scope with checkpoints.

The caller opens a scope with `reporting` and sets the action at checkpoints; functions deep inside call
`checkpoint` and need no callback through every signature (the pattern of Trio's cancel scopes). Without a
scope a checkpoint does nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

OnProgress = Callable[[str, float], None]
"""Called at every checkpoint, some hundred times a second, with the stage's name and the share of the whole
work in [0, 1] that is done; raises `Cancelled` to end the work. May be called from several threads."""


class Cancelled(Exception):  # noqa: N818
    """The user wants no more of the work that is under way."""


@dataclass(frozen=True)
class _Scope:
    on_progress: OnProgress
    stage: str = ""
    low: float = 0.0
    high: float = 1.0


_scope: ContextVar[_Scope | None] = ContextVar("progress", default=None)


@contextmanager
def reporting(on_progress: OnProgress) -> Iterator[None]:
    """Open a scope: `on_progress` is called at every checkpoint within it."""
    with _entered(_Scope(on_progress)):
        yield


@contextmanager
def stage(name: str, low: float, high: float) -> Iterator[None]:
    """Name the work within and the share [low, high] of the surrounding work that it is, in [0, 1]."""
    scope = _scope.get()
    with _entered(scope and _part(replace(scope, stage=name), low, high)):
        checkpoint()
        yield


def checkpoint(done: float = 0.0) -> None:
    """Report the done share of the present stage, in [0, 1].

    Call it every tenth of a second or more often.

    Raises:
        Cancelled: The user cancels.
    """
    scope = _scope.get()
    if scope is not None:
        scope.on_progress(scope.stage, scope.low + done * (scope.high - scope.low))


@contextmanager
def part(number: int, count: int) -> Iterator[None]:
    """The work within is the part `number`, from 0 on, of `count` equal ones of the present stage."""
    scope = _scope.get()
    with _entered(scope and _part(scope, number / count, (number + 1) / count)):
        checkpoint()
        yield


def in_this_scope[**P, R](function: Callable[P, R]) -> Callable[P, R]:
    """The function, for another thread to call: checkpoints in it are those of the present scope."""
    scope = _scope.get()

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        with _entered(scope):
            return function(*args, **kwargs)

    return call


def _part(scope: _Scope, low: float, high: float) -> _Scope:
    """The scope of the part [low, high] of a scope's work."""
    width = scope.high - scope.low
    return replace(scope, low=scope.low + low * width, high=scope.low + high * width)


@contextmanager
def _entered(scope: _Scope | None) -> Iterator[None]:
    before = _scope.get()
    _scope.set(scope)
    try:
        yield
    finally:
        _scope.set(before)
