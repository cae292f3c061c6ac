"""Build the documentation as a site with search, into build/site; a link that leads nowhere ends it.

    python tools/docs_site.py

The pages keep their places in the repository, so that their links hold in both.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = ROOT / "build" / "docs"
VENV = ROOT / "build" / "docs-venv"
PYTHON = str(VENV / "bin" / "python")
MKDOCS = "mkdocs==1.6.1"
SHOWN = "*.md", "docs/**/*", "benchmarks/results/**/*.md"
"""Files of the site by pattern; pictures and clips that they show come along."""


def main() -> int:
    stage(PAGES)
    if not (VENV / MKDOCS).exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(VENV)], check=True)
        subprocess.run([PYTHON, "-m", "pip", "install", "-q", MKDOCS], check=True)
        (VENV / MKDOCS).touch()
    settings = ROOT / "tools" / "mkdocs.yml"
    status = subprocess.run(
        [PYTHON, "-m", "mkdocs", "build", "--strict", "--config-file", str(settings)], check=False
    ).returncode
    if not status:
        print(ROOT / "build" / "site" / "index.html")
    return status


def stage(folder: Path) -> None:
    """Copy the pages and what they show into a new folder, each to its place in the repository."""
    shutil.rmtree(folder, ignore_errors=True)
    files = {file for pattern in SHOWN for file in ROOT.glob(pattern) if file.is_file()}
    for page in [file for file in files if file.suffix == ".md"]:
        links = re.findall(r"\]\(([^)#:]+)\)", page.read_text())
        files |= {file for link in links if (file := (page.parent / link).resolve()).is_file()}
    for file in files:
        target = folder / file.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, target)


if __name__ == "__main__":
    sys.exit(main())
