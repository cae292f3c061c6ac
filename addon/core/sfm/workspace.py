"""The working folder that keeps a solve.

DIR/solve.json   the clip, its frames, the options of the solve, and the report
DIR/model/       the reconstruction as a COLMAP text model
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..base import atomic
from ..base.counting import counted
from ..base.errors import Remedy, UserError
from ..base.file_names import checked_name
from ..camera.reconstruction import Reconstruction, upright
from ..media.clip import Footage, FrameRange, open_footage
from ..media.clip_identity import clip_exists, identity, is_same_clip
from ..media.video import first_frame
from ..media.video_info import VideoInfo
from ..readers.colmap_export import read_model, write_model
from ..readers.matching import Imported
from .report import SOURCES, Figures, Report, report
from .state import (
    MODEL,
    STATE,
    Staging,
    UnusableStateError,
    check_model,
    read_state,
    recorded_places,
    recover,
)


@dataclass(frozen=True)
class Solve:
    """A finished solve and its clip."""

    work_dir: Path
    footage: Path
    frames: tuple[int, ...]
    reconstruction: Reconstruction
    figures: Figures
    """Those of the solver or reader."""
    video: VideoInfo | None = None
    """Properties of the clip; None if it is not a video."""
    is_stills: bool = False
    """As of `Footage`."""
    pixel_aspect: float = 0.0
    """As of `Footage`."""

    def open_clip(self, frames: FrameRange | Iterable[int] | None = None) -> Footage:
        """Return the clip, all of it or some of its frames; UserError as `open_footage` and `check_size`."""
        clip = open_footage(
            self.footage, frames, info=self.video, stills=self.is_stills, pixel_aspect=self.pixel_aspect
        )
        check_size(clip, self.reconstruction)
        return clip

    @cached_property
    def quality(self) -> Report:
        """The numbers and the advice."""
        return report(self.reconstruction, self.frames, self.figures)

    @property
    def summary(self) -> str:
        """One line for the user."""
        it = self.quality
        missed = it.reprojection_error
        error = "not measured" if missed is None else f"{missed:.2f} px"
        sure = f" (±{100 * it.focal_sigma:.1f}%)" if it.focal_from == "clip" and it.focal_sigma else ""
        return (
            f"{it.registered} of {counted(it.frames, 'frame')} registered,"
            f" {counted(it.points, 'point')}, reprojection error {error},"
            f" focal length {SOURCES.get(it.focal_from, SOURCES['metadata'])[1]} {it.focal[0]:.0f} px{sure}"
        )


def check_size(clip: Footage, reconstruction: Reconstruction) -> None:
    """Check that a clip is shown in the size of its solve, as older versions may not have; or UserError."""
    camera, size = reconstruction.cameras[0], (clip.width, clip.height)
    if reconstruction.is_ordered and (camera.width, camera.height) != size:
        raise UserError(
            f"{clip.path.name} was solved as {camera.width}x{camera.height}, and is shown as"
            f" {size[0]}x{size[1]} now, as its files say; solve it again",
            Remedy.AGAIN,
        )


def default_work_dir(footage: Path, beside: Path) -> Path:
    """Return the working folder of a clip when none is named: `<clip>.aperture` in the folder `beside`."""
    stem = footage.name.replace("#", "").replace("%", "") or footage.parent.name
    return beside / f"{Path(stem).stem if footage.suffix else stem}.aperture"


def load_solve(work_dir: Path, clip: Path | None = None) -> Solve:
    """Return the solve that a working folder keeps.

    Its clip is the first of `clip`, the folder's own copy and the place where it lay that is the one that was
    solved. UserError where there is no solve, its model was altered, or its clip is gone or another one.
    """
    checked_name(work_dir.absolute())
    recover(work_dir)
    state = read_state(work_dir)
    if state is None:
        raise UserError(f"{work_dir} holds no solve; solve the clip into it first", Remedy.SOLVE)
    footage = _clip_of(work_dir, state, clip)
    check_model(work_dir / MODEL, state)
    frames = tuple(state["frames"])
    video = _video_of(footage, VideoInfo.parse(state.get("video")))
    is_stills = state.get("stills") is True
    figures = _figures(work_dir, state)
    readout = figures.lens.readout if figures.lens is not None else (0.0, 0.0)
    reconstruction = replace(read_model(work_dir / MODEL), is_ordered=not is_stills, readout=readout)
    aspect = state.get("pixel_aspect")
    return Solve(
        work_dir, footage, frames, reconstruction, figures, video, is_stills,
        float(aspect) if isinstance(aspect, int | float) else 0.0,
    )  # fmt: skip


def _figures(work_dir: Path, state: dict[str, Any]) -> Figures:
    """Those of a state; UserError where they are damaged."""
    try:
        return Figures.read(state["report"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UserError(
            f"the report in {work_dir / STATE} is damaged ({error}); solve again in its place", Remedy.AGAIN
        ) from error


def _clip_of(work_dir: Path, state: dict[str, Any], clip: Path | None) -> Path:
    places = [*([clip] if clip is not None else []), *recorded_places(work_dir, state)]
    there = [place for place in places if clip_exists(place)]
    for place in there:
        if is_same_clip(place, state["identity"]):
            return place
    if there:
        raise UserError(
            f"the clip {there[0]} is not the one solved in {work_dir}: it was changed or replaced; put the"
            " solved one back, or solve this one",
            Remedy.AGAIN,
        )
    raise UserError(f"the clip {state['footage']} of {work_dir} is missing; put it back, or solve again")


def _video_of(footage: Path, kept: VideoInfo | None) -> VideoInfo | None:
    """The video of a state as far as the file, whose solve may be forged, agrees; or UserError."""
    if kept is None or not footage.is_file() or kept.count > footage.stat().st_size:
        return None
    said = kept.width, kept.height, kept.colour_space, kept.view
    return kept if said == first_frame(footage)[:4] else None


def recorded_clip(work_dir: Path) -> Path | None:
    """Return the path of the clip in a working folder's state; None without one."""
    try:
        state = read_state(work_dir)
    except UserError:
        return None
    return (work_dir / state["relative"]).resolve() if state is not None and state["relative"] else None


class SolveThereError(UserError):
    """The folder holds a solve of the clip already."""


def is_solved(work_dir: Path, footage: Footage, options: dict[str, Any], again: bool = False) -> bool:
    """Return whether the folder holds this very solve, which need not be made then.

    Args:
        work_dir: The folder.
        footage: The clip.
        options: Those of the solve; with "imported" it is another program's, which replaces none unasked.
        again: True if a solve of the clip may be replaced, also a damaged one, and one whose clip was
            replaced by this one.

    Raises:
        UserError: The folder holds something else, another clip's solve, or an import.
        SolveThereError: There is a solve of the clip that an import would replace.
    """
    try:
        state = _state_of(work_dir, footage)
    except (UnusableStateError, _ClipReplacedError):
        if again:
            return False
        raise
    there = (work_dir / MODEL).is_dir()
    if state is None or again or ("imported" in options and not there):
        return False
    if "imported" in options:
        raise SolveThereError(
            f"{work_dir} already holds a solve of this clip; choose another folder, or replace it",
            Remedy.WORK_DIR,
            Remedy.AGAIN,
        )
    if imported := state.get("imported"):
        # Another program's cameras may have cost more than a solve, and are not thrown away unasked.
        raise UserError(
            f"{work_dir} holds an imported solve ({imported}); keep using it, choose another folder, or"
            " replace it",
            Remedy.WORK_DIR,
            Remedy.AGAIN,
        )
    kept = {"pixel_aspect": 0.0, **state}
    same = all(value in (None, kept.get(name, value)) for name, value in options.items())
    return same and there and tuple(state["frames"]) == footage.frames


def keep_import(found: Imported, footage: Footage, work_dir: Path, again: bool = False) -> None:
    """Keep another program's solve, in its own unit, as if it were our own.

    UserError where the folder holds something else, or is being solved into; SolveThereError where it holds a
    solve of the clip, of whichever frames and whosever, that is not to be replaced `again`.
    """
    options = {"imported": found.format}
    is_solved(work_dir, footage, options, again)
    clip_identity = identity(footage.path)
    reconstruction = found.reconstruction if found.placed else upright(found.reconstruction)
    staging = Staging(work_dir)
    try:
        is_solved(work_dir, footage, options, again=True)
        model = staging.folder / MODEL
        model.mkdir()
        write_model(model, reconstruction)
        figures = Figures(found.format, notes=(*footage.notes, *found.notes), observed=not found.projected)
        staging.keep(footage, clip_identity, options, figures)
    finally:
        staging.discard()


class _ClipReplacedError(UserError):
    """The clip that a solve is of was changed, or another one is in its place."""


def _state_of(work_dir: Path, footage: Footage) -> dict[str, Any] | None:
    """The state of the folder's solve of the clip; UserError if it holds something else."""
    checked_name(work_dir.absolute())
    if not work_dir.exists():
        return None
    if not work_dir.is_dir():
        raise UserError(f"{work_dir} is a file; choose a folder", Remedy.WORK_DIR)
    recover(work_dir)
    state = read_state(work_dir)
    if state is None:
        if any(not p.name.startswith((".solving", atomic.PART)) for p in work_dir.iterdir()):
            raise UserError(
                f"{work_dir} is not empty and holds no solve; choose another folder", Remedy.WORK_DIR
            )
        return None
    if not is_same_clip(footage.path, state["identity"]):
        if footage.path.resolve() in [place.resolve() for place in recorded_places(work_dir, state)]:
            raise _ClipReplacedError(
                f"{footage.path} is no longer the clip that was solved in {work_dir}: it was changed or"
                " replaced; solve again in place of the old solve, or choose another folder",
                Remedy.AGAIN,
                Remedy.WORK_DIR,
            )
        raise UserError(
            f"{work_dir} holds the solve of {Path(state['footage']).name}, not of {footage.path.name};"
            " choose another folder",
            Remedy.WORK_DIR,
        )
    return state
