"""Solving a clip in a worker process."""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..base.atomic import collect_temporary
from ..base.calls import Failed
from ..base.errors import UserError
from ..base.messages import Progress
from ..base.worker import Call, Worker, end
from ..camera.focal_length import Focal, in_pixels
from ..depth.placed_points import placed
from ..depth.user_maps import open_depth
from ..media.clip import FrameRange, open_footage
from ..media.clip_identity import identity
from ..media.video_info import VideoInfo
from ..readers.colmap_export import read_model, write_model
from ..readers.matching import Imported
from .mapping.known_poses import thinned
from .report import STAYS, Figures
from .state import MODEL, Staging
from .steps import Sight
from .worker import SolveJob, solve
from .workspace import is_solved

END = 0.3
"""Seconds until the worker ends on its own: it has nothing to clean up, and the user waits."""
LOOK = 0.05
"""Seconds between two looks at the worker."""


@dataclass(frozen=True)
class SolveProgress:
    """How far a solve is."""

    text: str
    share: float
    left: float | None = None
    """Seconds that it will still take; None while they cannot be estimated."""

    @property
    def stage(self) -> str:
        """Name of the present step, without its progress."""
        return self.text.rstrip(" 0123456789/")


class SolveProcess:
    """A solve under way in the worker process.

    Raises UserError at once for a clip that cannot be read, a focal length that cannot be, and a working
    folder that is not ours, another clip's, being solved into by somebody else, or, unless `again`, an
    import's; with cameras that are held, any solve's. Whatever ends it, the folder then holds either the old
    solve or the whole new one.
    """

    def __init__(
        self,
        footage: Path,
        work_dir: Path,
        frames: FrameRange | None = None,
        focal: Focal | None = None,
        again: bool = False,
        zooms: bool = False,
        yielding: bool = False,
        cameras: Imported | None = None,
        depth_maps: Path | None = None,
        stills: bool = False,
        pixel_aspect: float = 0.0,
        fixed: bool = True,
        segmenter: Path | None = None,
    ) -> None:
        """Start a solve.

        Args:
            footage: The clip.
            work_dir: Working folder.
            frames: Range of frames.
            focal: Known focal length.
            again: True to replace a solve.
            zooms: True if the lens zooms.
            yielding: True to give other programs priority, such as the interface.
            cameras: Another program's cameras, which are held.
            depth_maps: Maps for a camera that stays in its place, which is refused without.
            stills: True for unordered photos; a sequence that cannot be followed may turn out to be photos.
            pixel_aspect: As of `open_footage`.
            fixed: True to leave out what is burnt into the clip.
            segmenter: The user's own, whose subject a clip that is refused is solved without.
        """
        self.work_dir = work_dir
        self._yields, self._segmenter = yielding, segmenter
        self._cameras = cameras
        self._job = Worker("solving process")
        self._call: Call[Figures] | None = None
        self._staging: Staging | None = None
        self.sight: Sight | None = None
        """The tracker's last picture."""
        collect_temporary()
        self.clip = open_footage(footage, frames, stills=stills, pixel_aspect=pixel_aspect)
        self.clip.close()
        self._identity = identity(self.clip.path)
        pixels = None if focal is None else in_pixels(focal, self.clip.width, self.clip.height)
        self._maps = None if depth_maps is None else open_depth(depth_maps, self.clip)
        self._options: dict[str, Any] = {
            **({"focal": pixels, "zooms": zooms} if cameras is None else {"imported": cameras.format}),
            # Values that were not requested are taken from the kept solve.
            "stills": self.clip.is_stills or None, "pixel_aspect": pixel_aspect or None, "fixed": fixed,
        }  # fmt: skip
        self.finished = is_solved(work_dir, self.clip, self._options, again)
        if self.finished:
            return
        self._staging = Staging(work_dir)
        try:
            # Somebody else may have come to the end meanwhile.
            self.finished = is_solved(work_dir, self.clip, self._options, again)
            if self.finished:
                self._clean()
            else:
                self._launch(self._staging.folder)
        except OSError as error:
            self.cancel()
            raise UserError(f"the solving process cannot be started: {error.strerror}") from None
        except UserError:
            self.cancel()
            raise

    def _launch(self, folder: Path) -> None:
        held = self._cameras
        if held is not None and len(held.reconstruction.points):
            held = replace(held, reconstruction=thinned(held.reconstruction))
        job = SolveJob(
            self.clip, self._options.get("focal"), self._options.get("zooms", False), self._options["fixed"],
            self._maps is not None, self._segmenter, held,
        )  # fmt: skip
        self._job.start([*self._command(), str(folder)], None, self._yields, environment())
        self._call = self._job.call(partial(solve, job, folder))

    def _command(self) -> list[str]:
        """Command of the worker, without the folder that it solves into."""
        return _worker_command()

    def poll(self) -> list[SolveProgress]:
        """Return the events since the last call, with `finished` at the end.

        Raises:
            UserError: The solve failed.
        """
        steps: list[SolveProgress] = []
        for message in self._job.poll():
            if isinstance(message, Progress) and message.call is None:
                step = f" {message.done}/{message.total}" if message.total > 1 else ""
                steps.append(SolveProgress(message.stage + step, self._job.share, self._job.left))
        if self._call is not None and self._call.shown:
            self.sight = self._call.shown.pop()
            self._call.shown.clear()
        if self._staging is not None and self._call is not None and self._call.ended:
            self._job.leave()
            try:
                self._keep(self._call.result())
            except Failed as error:
                text, trace = error.args
                raise UserError(f"solving failed: {text}") from RuntimeError(trace)
            finally:
                self._clean()
        return steps

    def wait(self, report: Callable[[SolveProgress], None] = lambda _: None) -> None:
        """Poll to the end."""
        while not self.finished:
            for step in self.poll():
                report(step)
            self._job.wait(LOOK)

    def cancel(self) -> None:
        """End the worker and leave the folder as it was; harmless after the end."""
        end([self._job], END)
        self._clean()

    def _keep(self, figures: Figures) -> None:
        assert self._staging is not None
        self._options["stills"] = figures.stills
        if figures.method == STAYS and self._maps is not None:
            # Its points have no distances of their own.
            model = self._staging.folder / MODEL
            write_model(model, placed(read_model(model), self._maps))
        self._staging.keep(self.clip, self._identity, self._options, figures)
        self.finished = True

    def _clean(self) -> None:
        if self._staging is not None:
            self._staging.discard()
            self._staging = None
            # The worker's own, where it was ended.
            collect_temporary()


class Opening:
    """A clip that is being opened in a process: a video's frames are counted, all bytes are read, in seconds.

    This process remembers the result, so that the clip opens at once then.
    """

    def __init__(self, clip: Path, stills: bool) -> None:
        """Begin to open a clip; `stills` as of `open_footage`. UserError if the process cannot be started."""
        self._clip, self._stills = clip, stills
        self._worker = Worker("process that opens the clip")
        self._worker.start(_worker_command(), yielding=True, environment=environment())
        self._call = self._worker.call(partial(opened, clip, stills))

    def poll(self) -> bool:
        """Return whether the clip is open; UserError where it cannot be opened."""
        self._worker.poll()
        if not self._call.ended:
            return False
        self.end()
        open_footage(self._clip, info=self._call.result(), stills=self._stills).close()
        return True

    def end(self) -> None:
        """End the process, without waiting for it; harmless after the end."""
        self._worker.leave()


def opened(clip: Path, stills: bool) -> VideoInfo | None:
    """Open a clip, read all that a solve asks of it, and return a video's properties."""
    footage = open_footage(clip, stills=stills)
    footage.close()
    identity(footage.path)
    return footage.video


def _worker_command() -> list[str]:
    """The command of a worker in Python alone; UserError without Python."""
    python = sys.executable
    if "python" not in Path(python).name.lower():
        # Blender's is its own Python; some builds name the program.
        folder = Path(sys.prefix, "bin")
        found = [*sorted(folder.glob("python3*")), *sorted(folder.glob("python.exe"))]
        if not found:
            raise UserError(f"no Python was found next to {python}; solving needs Blender's own Python")
        python = str(found[0])
    # -P: a folder called "addon" in the current directory must not be taken for ours.
    return [python, "-P", "-m", "addon.core.sfm.worker"]


def environment() -> dict[str, str]:
    """Return the environment of such a process."""
    # The worker finds our package under the plain name `addon`, whatever Blender calls the extension,
    # and the wheels on the path that Blender made for them.
    above = Path(__file__).resolve().parents[3]
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(above), *(p for p in sys.path if p)])}
