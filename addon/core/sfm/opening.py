"""Opening a clip in another process: a video's frames are counted, and all bytes are read, in seconds.

The process that asked for it remembers the result, so that the clip opens at once then.
"""

from functools import partial
from pathlib import Path

from ..base.calls import serve
from ..base.messages import speak
from ..base.worker import Worker
from ..media.clip import open_footage
from ..media.clip_identity import identity
from ..media.video_info import VideoInfo
from .process import environment, python_command


class Opening:
    """A clip that is being opened."""

    def __init__(self, clip: Path, stills: bool) -> None:
        """Begin to open a clip; `stills` as of `open_footage`. UserError if the process cannot be started."""
        self._clip, self._stills = clip, stills
        self._worker = Worker("process that opens the clip")
        self._worker.start(python_command("opening"), yielding=True, environment=environment())
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


if __name__ == "__main__":
    speak()
    serve()
