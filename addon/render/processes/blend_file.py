"""Scenes as .blend files for other processes and machines."""

from pathlib import Path

import bpy

from ...core.base import atomic
from ...core.base.errors import UserError
from ..views.quiet import quiet

ENDS = b"ENDB", b"\xb1\xea\x92\x8f"
"""Ends of a .blend: its last block, or, if it is compressed, the number of Zstandard's seek table."""


def write_blend(blend: Path) -> None:
    """Write the open scene as a .blend with relative paths, atomically.

    Raises:
        UserError: It cannot be written.
    """
    with atomic.staged(blend) as part:
        try:
            with quiet(1):
                bpy.ops.wm.save_as_mainfile(filepath=str(part), check_existing=False, copy=True)
        except RuntimeError as error:
            raise UserError(f"{blend} cannot be written: {str(error).strip()}") from None
        finally:
            part.with_name(part.name + "1").unlink(missing_ok=True)
        # Blender does not always notice that it could not write on.
        if not part.is_file() or not any(end in part.read_bytes()[-64:] for end in ENDS):
            raise UserError(f"{blend} could not be written completely; is the disk full?")
