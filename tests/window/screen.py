"""A virtual screen with a window manager, its mouse and keys, and pictures of it."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

SETTLED = 0.15
"""Seconds until a program has looked what is under the mouse, where none is asked."""
PROGRAMS = ("Xvfb", "matchbox-window-manager", "xdotool", "import")


def missing_programs() -> list[str]:
    """Programs that are needed here and not installed."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


class Screen:
    """An X server of our own, `size` pixels wide and high; `environment` shows programs on it."""

    def __init__(self, size: tuple[int, int] = (1600, 1000)) -> None:
        self.size = size
        self.settle: Callable[[], None] = lambda: time.sleep(SETTLED)
        """Returns when a program has taken in the mouse's last move; the program sets its own."""
        self._server = subprocess.Popen(
            ["Xvfb", "-displayfd", "1", "-screen", "0", f"{size[0]}x{size[1]}x24", "+extension", "GLX",
             "-nolisten", "tcp", "-noreset"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        assert self._server.stdout is not None
        number = self._server.stdout.readline().strip()
        self.environment = {**os.environ, "DISPLAY": f":{number}", "LIBGL_ALWAYS_SOFTWARE": "1"}
        # Without a window manager no window gets the focus, and so no key.
        self._manager = subprocess.Popen(
            ["matchbox-window-manager", "-use_titlebar", "no"],
            env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def close(self) -> None:
        for process in (self._manager, self._server):
            process.terminate()
            process.wait()

    def _xdotool(self, *arguments: str) -> None:
        subprocess.run(["xdotool", *arguments], env=self.environment, check=True, capture_output=True)

    def move(self, x: float, y: float) -> None:
        self._xdotool("mousemove", str(round(x)), str(round(y)))

    def nudge(self) -> None:
        """Move the mouse by a pixel and back."""
        for by in ("1", "-1"):
            self._xdotool("mousemove_relative", "--", by, "0")

    def click(self, x: float, y: float, button: int = 1, held: str = "") -> None:
        """Move there, and click, with a key held down; buttons 4 and 5 are the wheel up and down."""
        self.move(x, y)
        # Blender looks what is under the mouse when it moves there.
        self.settle()
        if held:
            self._xdotool("keydown", held, "click", str(button), "keyup", held)
        else:
            self._xdotool("click", str(button))

    def double_click(self, x: float, y: float) -> None:
        self.move(x, y)
        self.settle()
        self._xdotool("click", "--repeat", "2", "--delay", "60", "1")

    def drag(self, *places: tuple[float, float]) -> None:
        """With the left button from place to place, in small steps."""
        self.move(*places[0])
        self.settle()
        self._xdotool("mousedown", "1")
        for start, end in pairwise(places):
            for n in range(1, 11):
                self.move(*(a + (b - a) * n / 10 for a, b in zip(start, end, strict=True)))
                time.sleep(0.02)
            # A busy Blender joins moves, and then begins where the mouse has come to.
            time.sleep(0.5)
        self._xdotool("mouseup", "1")

    def key(self, *names: str) -> float:
        """Press keys one after the other, as X names them ("ctrl+F12"); when the last one was sent."""
        sent = time.time()
        for name in names:
            sent = time.time()
            self._xdotool("key", name)
        return sent

    def type(self, text: str) -> None:
        self._xdotool("type", "--delay", "15", text)

    def picture(self, file: Path | None = None) -> NDArray[np.uint8]:
        """(H, W, 3) RGB of the screen now; also into a file."""
        done = subprocess.run(
            ["import", "-window", "root", "png:-"], env=self.environment, check=True, capture_output=True
        )
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(done.stdout)
        decoded = cv2.imdecode(np.frombuffer(done.stdout, np.uint8), cv2.IMREAD_COLOR)
        assert decoded is not None
        return np.ascontiguousarray(decoded[..., ::-1]).astype(np.uint8)
