"""What the window has after *Solve Clip*, with nothing picked: saved as a .blend to be rendered.

Run as a process of its own: `python -P nothing_picked.py addon/headless.py CLIP WORK FILE.blend SEGMENTER`,
which may be empty. The command line has no default focus, the window's operator has. It takes the solve that
WORK keeps.
"""

from __future__ import annotations

import sys
from pathlib import Path


def main(program: str, clip: str, work: str, blend: str, segmenter: str) -> None:
    """Choose the clip and its working folder in the panel, press *Solve Clip*, save."""
    sys.path.insert(0, str(Path(program).resolve().parents[1]))
    import bpy

    import addon

    addon.register()
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.virtual_aperture
    settings.footage, settings.work_dir, settings.segmenter = clip, work, segmenter
    bpy.ops.virtual_aperture.solve()  # type: ignore[attr-defined]
    marks = settings.marks.items
    print("in focus:", marks[0].name if len(marks) else "nothing", f"blur {settings.blur:.4f}")
    bpy.ops.wm.save_as_mainfile(filepath=blend, copy=True, check_existing=False)


if __name__ == "__main__":
    main(*sys.argv[1:])
