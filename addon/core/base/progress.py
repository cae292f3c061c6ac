"""Progress and cancellation of long work by scopes (the pattern of Trio's cancel scopes).

The caller opens a scope with `reporting`; functions deep inside call `checkpoint`, without a callback in
every signature. Without a scope a checkpoint does nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

OnProgress = Callable[[str, float], None]
"""Called at every checkpoint, some hundred times a second, with the stage's name and the finished share of
all work in [0, 1]. Raises `Cancelled` to end the work. Must be thread-safe."""


class Cancelled(Exception):  # noqa: N818
    """The user has cancelled the work."""


@dataclass(frozen=True)
class _Scope:
    on_progress: OnProgress
    stage: str = ""
    low: float = 0.0
    """Finished share of all work in [0, 1] at the beginning of the stage."""
    high: float = 1.0
    """The same at its end."""


_scope: ContextVar[_Scope | None] = ContextVar("progress", default=None)


@contextmanager
def reporting(on_progress: OnProgress) -> Iterator[None]:
    """Open a scope: `on_progress` is called at every checkpoint within."""
    with _entered(_Scope(on_progress)):
        yield


@contextmanager
def stage(name: str, low: float, high: float) -> Iterator[None]:
    """Name the work within, which is the share [low, high] of the surrounding work, in [0, 1]."""
    scope = _scope.get()
    with _entered(scope and _part(replace(scope, stage=name), low, high)):
        checkpoint()
        yield


def checkpoint(done: float = 0.0) -> None:
    """Report that a share `done` in [0, 1] of the stage is finished, every 0.1 s; raises Cancelled."""
    scope = _scope.get()
    if scope is not None:
        scope.on_progress(scope.stage, scope.low + done * (scope.high - scope.low))


@contextmanager
def part(number: int, count: int) -> Iterator[None]:
    """Open the scope of part `number`, from 0, of `count` equal parts of the stage."""
    scope = _scope.get()
    with _entered(scope and _part(scope, number / count, (number + 1) / count)):
        checkpoint()
        yield


def in_this_scope[**P, R](function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a function for another thread, so that its checkpoints report to the present scope."""
    scope = _scope.get()

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        with _entered(scope):
            return function(*args, **kwargs)

    return call


def _part(scope: _Scope, low: float, high: float) -> _Scope:
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
