"""A Blender in a window, as a user has it before them: mouse and keys go in, its state can be asked for."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .screen import Screen

ROOT = Path(__file__).resolve().parents[2]
"""Programs are run in the project's folder: one in a root of its own sees that and /tmp."""
DRIVER = Path(__file__).with_name("driver.py")
EXTENSION = "bl_ext.user_default.virtual_aperture"
BACKEND = os.environ.get("BACKEND", "")
"""Blender's graphics backend; empty for its own choice."""
SLOWER = 10.0
"""Factor on all time-outs: the machine may be busy, and a software Vulkan driver compiles for a minute before
a window is drawn for the first time."""
START = 60.0 * SLOWER
"""Seconds in which the program must have started."""
STILL = 0.2
"""Seconds between two pictures of a screen that must be alike before it is called still."""


def blender() -> str | None:
    """The program: the BLENDER variable, else `blender` on the path."""
    return shutil.which(os.environ.get("BLENDER") or "blender")


def command() -> list[str]:
    """The program, and the graphics backend that the BACKEND variable names, if it does."""
    program = blender()
    assert program is not None
    return [program, *(("--gpu-backend", BACKEND) if BACKEND else ())]


def headless(resources: Path, *arguments: str) -> str:
    """Run Blender without a window; what it printed. AssertionError where it failed."""
    process = subprocess.Popen(
        [*command(), *arguments],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(resources), "LIBGL_ALWAYS_SOFTWARE": "1"},
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        said = process.communicate(timeout=300 * SLOWER)[0]
    finally:
        end(process)
    assert process.returncode == 0, said[-3000:]
    return said


def end(process: subprocess.Popen[Any]) -> None:
    """End a program and what it started: it may be a script around Blender."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@dataclass(frozen=True)
class Button:
    """A button, by what it does, and a place on it, pixels from the screen's top left."""

    does: str
    x: float
    y: float


class Program:
    """Blender in the full screen's window, with settings of its own in the folder `resources`.

    `pictures` takes the screenshots. The console is kept in `console`.
    """

    def __init__(self, screen: Screen, resources: Path, pictures: Path, *arguments: str) -> None:
        self.screen, self.pictures = screen, pictures
        pictures.mkdir(parents=True, exist_ok=True)
        # Sockets' paths must be short.
        self._folder = resources.parent / f"{resources.name}.window"
        self._folder.mkdir(exist_ok=True)
        self.console = self._folder / "console.txt"
        self.console.touch()
        self.forget_said()
        where = self._folder / f"{time.monotonic_ns()}"
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(where))
        listener.listen(1)
        shutil.copy(DRIVER, self._folder)
        with self.console.open("ab") as console:
            self._process = subprocess.Popen(
                [*command(), "--window-geometry", "0", "0", *map(str, screen.size), *arguments,
                 "--python", str(self._folder / DRIVER.name), "--", str(where)],
                env={**screen.environment, "BLENDER_USER_RESOURCES": str(resources)},
                cwd=ROOT, stdout=console, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        listener.settimeout(START)
        try:
            self._connection = listener.accept()[0]
        except TimeoutError:
            self.close()
            raise AssertionError(f"Blender did not start: {self.said()[-3000:]}") from None
        finally:
            listener.close()
        self._answers = self._connection.makefile("r")
        self.ask("1")
        screen.settle = self.settle

    def close(self) -> None:
        end(self._process)

    def wait_end(self) -> None:
        """Wait until Blender has ended by itself."""
        self._process.wait(30 * SLOWER)

    def said(self) -> str:
        """What Blender printed since its start, or since `forget_said`."""
        return self.console.read_bytes()[self._before :].decode(errors="replace")

    def forget_said(self) -> None:
        """Leave out of `said` what has been printed: by other programs, or by an error that is provoked."""
        self._before = self.console.stat().st_size

    # Asking

    def ask(self, question: str, seconds: float = 60.0) -> Any:
        """The value of a Python expression (after statements) in Blender's driver."""
        self._connection.settimeout(seconds * SLOWER)
        self._connection.sendall(json.dumps(question).encode() + b"\n")
        line = self._answers.readline()
        if not line:
            raise AssertionError(f"Blender ended while it was asked {question!r}: {self.said()[-3000:]}")
        answer = json.loads(line)
        if "error" in answer:
            raise AssertionError(f"{question}\n{answer['error']}")
        return answer["value"]

    def wait(self, question: str, seconds: float = 30.0, every: float = 0.05) -> Any:
        """Ask until the answer is true; that answer. AssertionError after `seconds`."""
        until = time.monotonic() + seconds * SLOWER
        while not (value := self.ask(question)):
            if time.monotonic() > until:
                self.shot("timeout")
                raise AssertionError(f"not true in {seconds:g} s: {question}\n{self.said()[-2000:]}")
            time.sleep(every)
        return value

    def settle(self) -> None:
        """Until Blender has taken in all events and drawn its windows."""
        for _ in range(3):
            self.ask("1")
            time.sleep(0.05)

    def still(self) -> None:
        """Wait until the screen shows the same twice, as when a menu has opened."""
        before = None
        for _ in range(50):
            self.settle()
            now = self.screen.picture()
            if before is not None and np.array_equal(now, before):
                return
            before = now
            time.sleep(STILL)
        raise AssertionError("the screen goes on changing")

    def shot(self, name: str) -> Any:
        """A picture of the screen, kept under a name."""
        return self.screen.picture(self.pictures / f"{name}.png")

    # Places

    def rectangle(self, kind: str, region: str = "WINDOW", window: int = 0) -> tuple[int, int, int, int]:
        """Left, top, width, height of a region of the largest area of a kind, pixels on the screen."""
        left, bottom, width, height = self.ask(f"rectangle({kind!r}, {region!r}, {window})")
        return left, self.screen.size[1] - bottom - height, width, height

    def middle(self, kind: str, region: str = "WINDOW", window: int = 0) -> tuple[float, float]:
        left, top, width, height = self.rectangle(kind, region, window)
        return left + width / 2, top + height / 2

    def buttons(
        self, kind: str, region: str, across: float = 0.6, step: int = 8, window: int = 0
    ) -> list[Button]:
        """Buttons that the mouse meets on its way down a region, at a share of its width."""
        return list(self._met(kind, region, across, step, window))

    def _met(self, kind: str, region: str, across: float, step: int, window: int) -> Iterator[Button]:
        left, top, width, height = self.rectangle(kind, region, window)
        last = ""
        under = f"button_under_mouse({kind!r}, {region!r}, {window})"
        for y in range(top + 2, top + height, step):
            self.screen.move(left + across * width, y)
            if y == top + 2:
                # Away from the button where the mouse was.
                self.settle()
            self.ask("1")
            does = self.ask(under)
            if does and last != does:
                last = does
                yield Button(does, left + across * width, y + 3)

    def find(self, does: str, kind: str, region: str, across: float = 0.6, window: int = 0) -> Button:
        """The first button of a region that does this (a part of its operator's call or property's path);
        the region is scrolled down to it."""
        seen: list[Button] = []
        for _ in range(6):
            now: list[Button] = []
            for button in self._met(kind, region, across, 8, window):
                now.append(button)
                if does in button.does and self._is_there(button, kind, region, window):
                    return button
            if seen and [b.does for b in now] == [b.does for b in seen]:
                break
            seen = now
            x, y = self.middle(kind, region, window)
            for _ in range(4):
                self.screen.click(x, y, 5)
            self.settle()
        self.shot("missing_button")
        raise AssertionError(f"no button {does!r}; there are {[b.does for b in seen]}")

    def _is_there(self, button: Button, kind: str, region: str, window: int) -> bool:
        """Whether a button is where it was seen: Blender may have been behind the mouse."""
        self.screen.move(*self.middle(kind, region, window))
        self.settle()
        self.screen.move(button.x, button.y)
        self.settle()
        under: str = self.ask(f"button_under_mouse({kind!r}, {region!r}, {window})")
        return under == button.does

    # Doing

    def press(self, does: str, kind: str = "VIEW_3D", region: str = "UI", across: float = 0.6) -> None:
        """Find a button, and click it."""
        button = self.find(does, kind, region, across)
        self.screen.click(button.x, button.y)
        self.settle()

    def show_sidebar(self, tab: str) -> None:
        """N over the 3D viewport, and a click on a tab."""
        if not self.ask('view("VIEW_3D")["area"].spaces.active.show_region_ui'):
            self.screen.move(*self.middle("VIEW_3D"))
            self.settle()
            self.screen.key("n")
            self.wait('view("VIEW_3D")["area"].spaces.active.show_region_ui')
            self.wait('region_of("VIEW_3D", "UI")["region"].width > 50')
        category = 'region_of("VIEW_3D", "UI")["region"].active_panel_category'
        left, top, width, height = self.rectangle("VIEW_3D", "UI")
        for y in range(top + 20, top + height, 30):
            if self.ask(category) == tab:
                return
            self.screen.click(left + width - 8, y)
            self.settle()
        raise AssertionError(f"no tab {tab!r}")

    def choose_file(self, file: Path, new: bool = False) -> None:
        """Type a file's path into the file browser that has opened, and accept.

        Of a new file, its folder goes into the field of the path and its name into that of the name.
        """
        kinds = "[[area.type for area in w.screen.areas] for w in bpy.context.window_manager.windows]"
        self.wait(f"['FILE_BROWSER'] in {kinds}")
        window = self.ask(f"{kinds}.index(['FILE_BROWSER'])")
        self.settle()
        left, top, width, height = self.rectangle("FILE_BROWSER", "UI", window)
        path = file.parent if new else file
        self.fill(Button("path", left + 0.35 * width, top + height / 2), str(path))
        if new:
            left, top, width, height = self.rectangle("FILE_BROWSER", "EXECUTE", window)
            self.fill(Button("name", left + 0.25 * width, top + height / 2), file.name)
        chosen = f"view('FILE_BROWSER', {window})['area'].spaces.active.params.filename"
        self.wait(f"{chosen} == {file.name!r}")
        # The path is still being edited; a click beside it ends that.
        left, top, width, height = self.rectangle("FILE_BROWSER", "WINDOW", window)
        self.screen.click(left + width / 2, top + height - 40)
        self.settle()
        self.shot(f"choose_{file.stem}")
        left, top, width, height = self.rectangle("FILE_BROWSER", "EXECUTE", window)
        self.screen.click(left + 0.92 * width, top + height / 2)
        self.wait(f"['FILE_BROWSER'] not in {kinds}")
        self.settle()

    # Rendering

    def render(self, *keys: str, seconds: float = 60.0) -> list[str]:
        """Press the keys that render (F12), wait until Blender has; what its handlers were told, in order."""
        before = self.ask("len(log)")
        self.screen.key(*(keys or ("F12",)))
        self.wait(f"[w for w, _ in log[{before}:] if w == 'idle']", seconds)
        written: list[str] = self.ask(f"[w for w, _ in log[{before}:]]")
        # What the job reported is shown when its operator ends, which is at the next event.
        self.screen.nudge()
        self.settle()
        return written

    def tell_time(self, seconds: float, what: str) -> None:
        """Tell how long something took."""
        self.tell(f"{what}: {seconds:.2f} s")

    def tell(self, text: str) -> None:
        """Print a measurement, and keep it beside the pictures: the machine's other work is in it, so it is
        told and not judged."""
        said = f"{text}, load {os.getloadavg()[0]:.1f}"
        print(said)
        with (self.pictures / "times.txt").open("a") as file:
            file.write(f"{said}\n")

    def close_window(self) -> None:
        """Close the window in front, by the window manager's key."""
        before = self.ask("len(bpy.context.window_manager.windows)")
        self.screen.key("alt+F4")
        self.wait(f"len(bpy.context.window_manager.windows) == {before - 1}")
        self.settle()

    def fill(self, button: Button, text: str) -> None:
        """Double click a text field, replace what is in it, Enter."""
        self.screen.double_click(button.x, button.y)
        self.settle()
        self.screen.key("ctrl+a")
        self.screen.type(text)
        self.screen.key("Return")
        self.settle()
