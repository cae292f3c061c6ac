"""Opening a clip in another process: a video's frames are counted, and all bytes are read, in seconds.

The process that asked for it remembers the result, so that the clip opens at once then.
"""

import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from ..base.atomic import temporary_folder
from ..base.calls import Caller, serve
from ..base.job import Job, end_meanwhile
from ..base.messages import speak
from ..media.clip import open_footage
from ..media.clip_identity import identity
from ..media.video_info import VideoInfo
from .process import environment, python_command


class Opening:
    """A clip that is being opened."""

    def __init__(self, clip: Path, stills: bool) -> None:
        """Begin to open a clip; `stills` as of `open_footage`. UserError if the process cannot be started."""
        self._clip, self._stills, self._held = clip, stills, ExitStack()
        self._job = Job("process that opens the clip")
        folder = self._held.enter_context(temporary_folder())
        try:
            self._job.start([*python_command("opening"), str(folder)], True, environment())
        except BaseException:
            self._held.close()
            raise
        self._caller = Caller(self._job, folder)
        self._call = self._caller.call(partial(opened, clip, stills))

    def poll(self) -> bool:
        """Return whether the clip is open; UserError where it cannot be opened."""
        self._caller.poll()
        if not self._call.ended:
            return False
        self.end()
        open_footage(self._clip, info=self._call.result(), stills=self._stills).close()
        return True

    def end(self) -> None:
        """End the process, without waiting for it; harmless after the end."""
        end_meanwhile([self._job], self._held.pop_all().close)


def opened(clip: Path, stills: bool) -> VideoInfo | None:
    """Open a clip, read all that a solve asks of it, and return a video's properties."""
    footage = open_footage(clip, stills=stills)
    footage.close()
    identity(footage.path)
    return footage.video


if __name__ == "__main__":
    speak()
    serve(Path(sys.argv[1]))
