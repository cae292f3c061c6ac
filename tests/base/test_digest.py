"""The digest of the add-on's code."""

from __future__ import annotations

from pathlib import Path

import pytest

from addon.core.base import digest


def test_another_line_is_other_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(digest, "ADDON", tmp_path)
    (tmp_path / "core" / "a").mkdir(parents=True)
    (tmp_path / "core" / "a" / "one.py").write_text("A = 1\n")
    before = digest.code_digest.__wrapped__("core")
    (tmp_path / "render").mkdir()
    assert digest.code_digest.__wrapped__("core") == before != digest.code_digest.__wrapped__("render")
    (tmp_path / "core" / "a" / "one.py").write_text("A = 2\n")
    assert digest.code_digest.__wrapped__("core") != before
