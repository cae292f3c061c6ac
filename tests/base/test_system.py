"""Systems that are too old are told so, before a library fails to load."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from addon.core.base.errors import UserError
from addon.core.base.system import MACOS, check_system

ROOT = Path(__file__).resolve().parents[2]


def test_an_old_macos_is_refused() -> None:
    for release in ("13.6.1", "12.0", "11"):
        with pytest.raises(UserError, match=f"needs macOS {MACOS} or newer, and this is macOS {release};"):
            check_system(release)
    for release in ("14.0", "15.3.1", "26", ""):
        check_system(release)
    check_system()


def test_it_is_what_the_wheels_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    from build_zip import TAGS

    versions = [int(found[1]) for tag in TAGS["macos-arm64"] if (found := re.match(r"macosx_(\d+)", tag))]
    assert max(versions) == MACOS
