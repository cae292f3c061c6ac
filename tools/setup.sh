#!/usr/bin/env bash
# Make the virtual environment in $1 with the versions that pyproject.toml pins.
set -euo pipefail
venv=$1

is_313() { [[ $("$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) == 3.13 ]]; }

python=
for candidate in python3.13 python3 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.13*/bin/python; do
  if command -v "$candidate" >/dev/null 2>&1 && is_313 "$candidate"; then python=$candidate; break; fi
done
if [[ -z $python ]]; then
  echo "Python 3.13 is needed and was not found; install it (for example: pyenv install 3.13) and try again" >&2
  exit 1
fi

echo "setting up $venv (Blender as a module is a large download)"
[[ -x $venv/bin/python ]] && is_313 "$venv/bin/python" || { rm -rf "$venv"; "$python" -m venv "$venv"; }
"$venv/bin/python" - >"$venv/requirements.txt" <<'PY'
import tomllib
project = tomllib.load(open("pyproject.toml", "rb"))
print("\n".join(project["project"]["dependencies"] + project["dependency-groups"]["dev"]))
PY
"$venv/bin/python" -m pip install -q --disable-pip-version-check -r "$venv/requirements.txt" 2> >(grep -v "is ignored: it is neither a file" >&2)

for module in av bpy cv2 pycolmap; do
  if ! "$venv/bin/python" -c "import $module" >"$venv/import.log" 2>&1; then
    tail -n 1 "$venv/import.log" >&2
    echo "the wheels need system libraries; on Debian: apt-get install $(tr '\n' ' ' <tools/debian-packages.txt)" >&2
    exit 1
  fi
done

"$venv/bin/python" tools/networks.py
