"""Scenes and costs of one thing each: `python -m benchmarks.special NAME`, with `--help` for its options.

Without a name it lists them.
"""

from __future__ import annotations

import importlib
import sys

ACCURACY, TIMINGS = "benchmarks.accuracy", "benchmarks.timings"
SPECIAL: dict[str, tuple[str, str]] = {
    "contact_sheet": (ACCURACY, "crops of the duck clip, as in the README (real data)"),
    "drawn_masks": (ACCURACY, "subjects of real clips against hand-drawn masks (real data)"),
    "envelope": (ACCURACY, "error over CPU seconds of every quality and its rivals, depth given and counted"),
    "keep_rule": (ACCURACY, "what a constant or a pass of the core is worth, in dB"),
    "lens": (ACCURACY, "the pictures of docs/lens.md: a frame under ten lenses, and under each effect"),
    "subjects": (ACCURACY, "masks and depth of people and animals that walk"),
    "first_frames": (TIMINGS, "a first frame by the length of its clip (real data)"),
    "frame_costs": (TIMINGS, "CPU seconds of a frame by stage, and its memory"),
    "gpu_sweep": (TIMINGS, "the plane sweep on the processor and on the GPU"),
    "real_costs": (TIMINGS, "real clips from command to written file; --profiles: by module (real data)"),
    "view_error": (TIMINGS, "error over the number of views"),
    "workers": (TIMINGS, "a movie by processes and by workers of a farm (real data)"),
    "whole_runs": (TIMINGS, "a clip from command to written file"),
}
"""By name, where its module lies and what it judges."""


def main() -> None:
    """Run the special benchmark that is named first, with the other arguments."""
    if len(sys.argv) < 2 or sys.argv[1] not in SPECIAL:
        listed = "\n".join(f"  {name:20}{what}" for name, (_, what) in SPECIAL.items())
        print(f"python -m benchmarks.special NAME [OPTIONS], NAME being one of\n{listed}")
        if len(sys.argv) > 1 and sys.argv[1] not in ("-h", "--help"):
            sys.exit(f"there is no special benchmark {sys.argv[1]}")
        return
    name = sys.argv.pop(1)
    sys.argv[0] = f"benchmarks.special {name}"
    importlib.import_module(f"{SPECIAL[name][0]}.{name}").main()


if __name__ == "__main__":
    main()
