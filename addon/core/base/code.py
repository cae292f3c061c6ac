"""Digest of the add-on's own code, which identifies the version that made a result."""

import hashlib
from functools import cache
from pathlib import Path

ADDON = Path(__file__).resolve().parents[2]


@cache
def code_digest(*rooms: str) -> str:
    """Digest all modules in some folders of `addon`, such as "core", to 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in rooms:
        for path in sorted((ADDON / room).rglob("*.py")):
            digest.update(path.relative_to(ADDON).as_posix().encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()[:16]
