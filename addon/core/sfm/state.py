"""The state of a working folder: `solve.json`, read and checked, and its model."""

import hashlib
import json
from pathlib import Path
from typing import Any

from ..base import atomic
from ..base.digest import file_digest
from ..base.errors import Remedy, UserError
from ..base.regular_file import read_object, read_regular

STATE = "solve.json"
MODEL = "model"
DIGEST = "digest"
"""Digest of the rest of a state; a state edited by hand may lack it."""
VERSION = 1
"""Version of the state's format; a later one is refused."""
LONGEST = 64 << 20
"""Bytes of a state at most: a frame's number takes ten, so it has room for days of video."""
_TYPES: dict[str, type] = {"footage": str, "relative": str, "identity": str, "frames": list, "report": dict}


class UnusableStateError(UserError):
    """A working folder's state cannot be read; solving again replaces it."""


def read_state(work_dir: Path) -> dict[str, Any] | None:
    """Return the content of `solve.json`, None without it; UnusableStateError if it cannot be used."""
    path = work_dir / STATE
    try:
        text = read_regular(path, LONGEST).decode()
        state = json.loads(text) if text else None
    except FileNotFoundError:
        return None
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise _damaged(path, "it is not JSON") from None
    if state is None:
        raise _damaged(path, "it is empty")
    if not isinstance(state, dict) or not isinstance(state.get("version"), int):
        raise _damaged(path, "it lacks a version")
    if state["version"] > VERSION:
        raise UnusableStateError(
            f"{path} was made with a newer Virtual Aperture; update the extension, or solve again",
            Remedy.AGAIN,
        )
    for name, kind in _TYPES.items():
        if not isinstance(state.get(name), kind):
            raise _damaged(path, f"it lacks {name}")
    if state.pop(DIGEST, None) not in (None, _digest(state)):
        raise _damaged(path, "it is not what the solve wrote")
    if not state["frames"] or not all(type(frame) is int for frame in state["frames"]):
        raise _damaged(path, "its frames are not numbers")
    return state


def is_state_file(path: Path) -> bool:
    """Return whether a file is a state file, wherever it lies, or has its name."""
    held = read_object(path)
    is_one = all(isinstance(held.get(name), kind) for name, kind in _TYPES.items())
    return is_one or (path.name == STATE and (path.parent / MODEL).is_dir())


def write_state(path: Path, state: dict[str, Any]) -> None:
    """Write `solve.json` with its own digest, durably: a later change is noticed. Raises OSError."""
    as_read = json.loads(json.dumps(state))
    path.write_text(json.dumps(as_read | {DIGEST: _digest(as_read)}, indent=1), encoding="utf-8")
    atomic.sync(path)


def _digest(state: dict[str, Any]) -> str:
    """64 hexadecimal digits of a state, in whichever order it is."""
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()


def _damaged(path: Path, why: str) -> UnusableStateError:
    return UnusableStateError(
        f"{path} is damaged ({why}); restore it, or solve again in its place", Remedy.AGAIN
    )


def model_digests(model: Path) -> dict[str, str]:
    """Return 64 hexadecimal digits for each file of a model, by its name."""
    return {path.name: file_digest(path) for path in sorted(model.iterdir()) if path.is_file()}


def check_model(model: Path, state: dict[str, Any]) -> None:
    """Check that a model is the one of a state; a state edited by hand may lack this.

    Raises:
        UserError: A file, which is named, is another one.
    """
    digests = state.get("model", {})
    for name, digest in digests.items() if isinstance(digests, dict) else ():
        path = model / str(name)
        if not path.is_file():
            raise UserError(f"{path} is missing; restore it, or solve again in its place", Remedy.AGAIN)
        if file_digest(path) != digest:
            raise UserError(
                f"{path} was changed or damaged after the solve; restore it, solve again in its place, or"
                " import your changes into another folder",
                Remedy.AGAIN,
            )


def recorded_places(work_dir: Path, state: dict[str, Any]) -> list[Path]:
    """Return possible paths of a state's clip: relative to the folder, which may have moved, and absolute."""
    beside = [(work_dir / state["relative"]).resolve()] if state["relative"] else []
    return [*beside, Path(state["footage"])]
