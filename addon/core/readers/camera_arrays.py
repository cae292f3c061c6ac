"""NumPy's .npz files with the cameras of video networks: MegaSaM, ViPE, Depth Anything 3.

All cameras look along +z with y down. MegaSaM and ViPE count pixels from the centre of the first pixel, like
the grids of DROID; ours count from its corner.

MegaSaM (`cvd_opt.py`, `camera_tracking_scripts/test_demo.py`, commit c83e41b): NAME_sgd_cvd_hr.npz with
images (n, h, w, 3), depths, intrinsic (3, 3), cam_c2w (n, 4, 4). Its pictures are the clip's, scaled to the
area of 512 x 384 and cropped at the right and bottom to multiples of 8; the intrinsics precede the crop.

ViPE 1.2 (`vipe/utils/io.py`): pose/NAME.npz with data (n, 4, 4) camera-to-world and inds (n,) frames from 0,
intrinsics/NAME.npz with data (n, 4) fx, fy, cx, cy and inds, intrinsics/NAME_camera.txt with lines such as
"0: PINHOLE".

Depth Anything 3 (exported as npz): depth (n, h, w), extrinsics (n, 3 or 4, 4) world-to-camera, intrinsics (n,
3, 3) for pictures of the depth's size.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from ..base.npz import array_shapes, read_arrays
from ..base.regular_file import read_regular
from ..camera.reconstruction import Intrinsics, Reconstruction
from ..media.sequence import is_litter
from .matching import Imported
from .parsing import wrong
from .poses import OPENCV, cameras, finite, lens

FORMAT = "camera arrays"
MOST = 2**28
"""Most bytes of poses and lenses together: half a million frames."""
CENTRE = 0.5
"""Distance in pixels from the first pixel's corner to its centre."""
AREA, MULTIPLE = 384 * 512, 8
"""MegaSaM's pictures: area in pixels, and divisor of both sides."""
MEGASAM, VIPE, DEPTH_ANYTHING = ("intrinsic", "cam_c2w"), ("data", "inds"), ("extrinsics", "intrinsics")


def recognises(path: Path) -> bool:
    """Return whether a file has one program's arrays, or a folder ViPE's poses of a single clip."""
    return _kind(path) != "" or _poses_in(path) is not None


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read the cameras of a file or of ViPE's folder; see `Reader.read`."""
    path = _poses_in(path) or path
    kind = _kind(path)
    if not kind:
        raise wrong(path, "an archive with the arrays of one program")
    model, names = KINDS[kind][1](path, size)
    return Imported(model, kind, names=names)


def _arrays(path: Path, names: tuple[str, ...]) -> dict[str, NDArray[np.generic]]:
    try:
        return read_arrays(path, names, MOST)
    except (ValueError, OSError) as error:
        raise UserError(f"{path} cannot be read: {error}; export it again") from None


def _kind(path: Path) -> str:
    if path.suffix.lower() != ".npz":
        return ""
    try:
        names = array_shapes(path).keys()
    except (OSError, ValueError):
        return ""
    return next((kind for kind, (wanted, _) in KINDS.items() if names >= set(wanted)), "")


def _poses_in(path: Path) -> Path | None:
    """Return the only file of poses in a folder of ViPE's results, or None."""
    files = path.glob("pose/*.npz") if path.is_dir() else ()
    found = [file for file in files if not is_litter(file.name)]
    return found[0] if len(found) == 1 and _kind(found[0]) == "ViPE" else None


def _megasam(path: Path, size: tuple[int, int]) -> tuple[Reconstruction, tuple[str, ...]]:
    read = _arrays(path, MEGASAM)
    matrix = finite(read["intrinsic"], (3, 3), f"{path}, intrinsic", "3 x 3 numbers")
    poses = finite(read["cam_c2w"], (-1, 4, 4), f"{path}, cam_c2w", "n x 4 x 4 numbers")
    shape = array_shapes(path).get("images", ())
    if len(shape) != 4:
        raise wrong(path, "images of n x h x w x 3, which give the size of the intrinsics")
    scale = np.sqrt(AREA / (size[0] * size[1]))
    scaled = int(size[0] * scale), int(size[1] * scale)
    is_cut = tuple(side - side % MULTIPLE for side in scaled) == (shape[2], shape[1])
    made = _pinhole(f"{path}, intrinsic", scaled if is_cut else (shape[2], shape[1]), matrix)
    return cameras(poses, OPENCV, [made] * len(poses), f"{path}, cam_c2w, row {{}}"), ("",) * len(poses)


def _vipe(path: Path, size: tuple[int, int]) -> tuple[Reconstruction, tuple[str, ...]]:
    lenses_path = path.parent.parent / "intrinsics" / path.name
    if not lenses_path.is_file():
        raise UserError(
            f"{lenses_path} is missing: ViPE's poses need the intrinsics beside them; export both again"
        )
    read, inner = (_arrays(each, VIPE) for each in (path, lenses_path))
    poses = finite(read["data"], (-1, 4, 4), f"{path}, data", "n x 4 x 4 numbers")
    frames = finite(read["inds"], (len(poses),), f"{path}, inds", "a frame for each pose").astype(int)
    _check_pinhole(lenses_path.with_name(f"{path.stem}_camera.txt"))
    values = finite(inner["data"], (-1, 4), f"{lenses_path}, data", "n x 4 numbers, fx fy cx cy")
    known = finite(inner["inds"], (len(values),), f"{lenses_path}, inds", "a frame for each lens").astype(int)
    if not np.isin(frames, known).all():
        missing = frames[np.argmin(np.isin(frames, known))]
        raise wrong(f"{lenses_path}, inds", f"the frames of {path.name}, {missing} among them")
    order = np.argsort(known)
    rows = order[np.searchsorted(known[order], frames)]
    lenses = [
        lens(f"{lenses_path}, data, row {row}", "PINHOLE", size, values[row] + [0, 0, CENTRE, CENTRE])
        for row in rows.tolist()
    ]
    model = cameras(poses, OPENCV, lenses, f"{path}, data, row {{}}")
    return model, tuple(str(frame) for frame in frames.tolist())


def _check_pinhole(path: Path) -> None:
    try:
        text = read_regular(path, 2**24).decode(errors="replace")
    except OSError:
        return
    others = {line.split(":")[-1].strip() for line in text.splitlines() if line.strip()} - {"PINHOLE"}
    if others:
        raise wrong(path, f"PINHOLE cameras, not {sorted(others)[0][:40]}; run ViPE with that")


def _depth_anything(path: Path, _size: tuple[int, int]) -> tuple[Reconstruction, tuple[str, ...]]:
    read = _arrays(path, DEPTH_ANYTHING)
    shape = array_shapes(path).get("depth", ())
    if len(shape) != 3:
        raise wrong(path, "depth of n x h x w, which gives the size of the intrinsics")
    given = np.asarray(read["extrinsics"])
    rows = 4 if given.ndim == 3 and given.shape[1] == 4 else 3
    poses = finite(given, (shape[0], rows, 4), f"{path}, extrinsics", "n x 3 x 4 numbers")
    matrices = finite(read["intrinsics"], (shape[0], 3, 3), f"{path}, intrinsics", "n x 3 x 3 numbers")
    lenses = [
        _pinhole(f"{path}, intrinsics, row {row}", (shape[2], shape[1]), matrix)
        for row, matrix in enumerate(matrices)
    ]
    turn = np.swapaxes(poses[:, :3, :3], 1, 2)
    to_world = np.concatenate([turn, -turn @ poses[:, :3, 3:]], axis=2)
    return cameras(to_world, OPENCV, lenses, f"{path}, extrinsics, row {{}}"), ("",) * len(poses)


def _pinhole(place: str, size: tuple[int, int], matrix: Floats) -> Intrinsics:
    """Make a lens from a 3 x 3 matrix of pixels that count from the centre of the first one."""
    values = matrix[[0, 1, 0, 1], [0, 1, 2, 2]] + [0, 0, CENTRE, CENTRE]
    return lens(place, "PINHOLE", size, values.tolist())


KINDS = {
    "MegaSaM": (MEGASAM, _megasam), "ViPE": (VIPE, _vipe),
    "Depth Anything 3": (DEPTH_ANYTHING, _depth_anything),
}  # fmt: skip
"""Arrays by which a program's file is recognised, and its reader."""
