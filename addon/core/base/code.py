"""Digest of the add-on's code, which identifies results of other versions."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

ADDON = Path(__file__).resolve().parents[2]


@cache
def code_digest(*rooms: str) -> str:
    """Digest the code of some folders of the add-on.

    Args:
        rooms: names of folders in `addon`, such as "core".

    Returns:
        16 hexadecimal digits of the names and bytes of all modules in them.
    """
    digest = hashlib.sha256()
    for room in rooms:
        for path in sorted((ADDON / room).rglob("*.py")):
            digest.update(path.relative_to(ADDON).as_posix().encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()[:16]
