"""Matching of the images of an imported model with the clip's frames.

Images match by file name and its folders, by name without extension, by the number in the name, or, if the
counts are equal, by order.
"""

import re
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

import numpy as np

from ..base.counting import common_step, counted, ordinal
from ..base.errors import Remedy, UserError
from ..camera.reconstruction import Image, Intrinsics, Reconstruction
from ..media.clip import Footage, describe

SAME_ASPECT = 0.01
"""Largest relative difference of the aspect ratios of clip and model, due to whole pixels."""
NO_PATH = 1e-4
"""Largest distance of cameras of a pure rotation, in units of the typical distance of points."""
ONLY_TURNS = "the camera only turns: all cameras are at one place, so the points have no depth of their own"
SHOWN = 5
"""Names of images in an error."""


@dataclass(frozen=True)
class Imported:
    """An imported model in our conventions, not normalised."""

    reconstruction: Reconstruction
    """`Image.frame` is an index into `names`; once matched, the clip's frame number, in order."""
    format: str
    """Displayed name: "COLMAP binary", "Bundler v0.3"."""
    notes: tuple[str, ...] = ()
    """Remarks for the user on skipped, assumed or invalid content, one sentence each."""
    names: tuple[str, ...] = ()
    """Names of all images in the file's order, registered or not, until they are matched; empty strings if it
    has none."""
    projected: bool = False
    """True if the file has no feature positions, so that features are the projections of points."""
    placed: bool = False
    """True if the world is that of an existing scene, and must not be moved."""

    @property
    def lacks_points(self) -> bool:
        """Return whether no point is seen by two frames, as for points computed from depth."""
        return not np.any(self.reconstruction.views_per_point > 1)


@dataclass
class _Pairing:
    """A possible assignment of images to frames."""

    frames: dict[int, int] = field(default_factory=dict)
    """The clip's frame by the image's index in the model."""
    doubtful: list[tuple[str, str, int]] = field(default_factory=list)
    """Pairs of images that match a frame equally well."""
    note: str = ""


def match(model: Imported, footage: Footage) -> Imported:
    """Assign the clip's frame numbers to a model's images, and the clip's size to its lenses.

    Raises UserError if no image matches a frame, several match the same one, or the model's pictures had
    another shape.
    """
    pairing = _pair(model, footage)
    notes = [*model.notes, pairing.note] if pairing.note else list(model.notes)
    images = model.reconstruction.images
    known = sorted(
        (
            replace(image, frame=pairing.frames[image.frame])
            for image in images
            if image.frame in pairing.frames
        ),
        key=lambda image: image.frame,
    )
    if not known:
        raise UserError(
            f"the images of the {model.format} model that have a camera are not in {footage.path.name};"
            " give the footage that was solved"
        )
    left_out = [_shown(model, image.frame) for image in images if image.frame not in pairing.frames]
    if left_out:
        are = "image of the model is" if len(left_out) == 1 else "images of the model are"
        notes.append(f"{len(left_out)} {are} not in the clip: {_some(left_out)}")
    frames = {image.frame for image in known}
    without = [frame for frame in footage.frames if frame not in frames]
    if without:
        have = "frame of the clip has" if len(without) == 1 else "frames of the clip have"
        named = describe(without) if common_step(without) > 1 else _some(list(map(str, without)))
        notes.append(f"{len(without)} {have} no camera: {named}")
    reconstruction = replace(model.reconstruction, images=tuple(known))
    reconstruction, scaled = _fitted(reconstruction, footage)
    notes += scaled
    if at_one_place(reconstruction):
        notes.append(ONLY_TURNS)
    return replace(model, reconstruction=reconstruction, notes=tuple(notes), names=())


def _pair(model: Imported, footage: Footage) -> _Pairing:
    named = {index: _parts(name) for index, name in enumerate(model.names) if name}
    registered = [image.frame for image in model.reconstruction.images]
    ways = [] if footage.is_video else [_by(named, footage, _file_name), _by(named, footage, _stem)]
    ways.append(_by_number(named, footage))
    # The most reliable assignment comes first, and max takes the first of equal counts.
    best = max(ways, key=lambda way: sum(index in way.frames for index in registered) + len(way.doubtful))
    if best.doubtful:
        first, second, frame = best.doubtful[0]
        raise UserError(
            f"frame {frame} of {footage.path.name} could be {first[-60:]} or {second[-60:]} of the"
            f" {model.format} model; remove one of them from the model or rename its pictures"
        )
    found = [index in best.frames for index in registered]
    # A program that was given every second frame numbers its images consecutively.
    is_stepped = len(model.names) == len(footage.frames) and common_step(footage.frames) > 1
    if all(found) or (any(found) and not (best is ways[-1] and is_stepped)):
        return best
    if len(model.names) == len(footage.frames):
        order = sorted(range(len(model.names)), key=lambda index: _natural(model.names[index]))
        by = "the order of their names" if named else "their order"
        note = f"the model's images are taken to be the clip's frames in {by}"
        return _Pairing(dict(zip(order, footage.frames, strict=True)), note=note)
    raise _no_match(model, footage)


def _no_match(model: Imported, footage: Footage) -> UserError:
    count = len(model.names)
    clip = f"{footage.path.name} has {describe(footage.frames)}"
    every = if_every(count, footage.frames)
    remedies = (Remedy.STEP,) if every else ()
    if not any(model.names):
        return UserError(
            f"the {model.format} model has {counted(count, 'camera')} without names, and {clip}: their"
            f" pictures are unknown; give the footage that was solved{every}",
            *remedies,
        )
    if footage.files:
        clip += f" ({_some([file.name for file in footage.files])})"
    return UserError(
        f"none of the {counted(count, 'image')} of the {model.format} model ({_some(list(model.names))})"
        f" is in the clip: {clip}; give the footage that was solved{every}",
        *remedies,
    )


def if_every(cameras: int, frames: Sequence[int]) -> str:
    """Return a hint for an error if the cameras may be of every n-th frame; otherwise empty."""
    step = round(len(frames) / max(cameras, 1))
    if step < 2 or -(-len(frames) // step) != cameras:
        return ""
    return (
        f"; if the cameras are of every {ordinal(step)} frame, import them for frames"
        f" {frames[0]}-{frames[-1]}:{step} alone"
    )


Parts = tuple[str, ...]


def _parts(name: str) -> Parts:
    """Split a path of any system into lower-case components, without a drive."""
    path = re.sub(r"^[A-Za-z]:", "", name.replace("\\", "/")).casefold()
    return tuple(part for part in PurePosixPath(path).parts if part not in ("/", "//", "."))


def _file_name(parts: Parts) -> str:
    return parts[-1] if parts else ""


def _stem(parts: Parts) -> str:
    path = PurePosixPath(_file_name(parts))
    # A numeric suffix may be the frame number, not an extension.
    return path.name if path.suffix[1:].isdecimal() else path.stem


def _by(named: dict[int, Parts], footage: Footage, key: Callable[[Parts], str]) -> _Pairing:
    clip = {frame: _parts(str(file)) for frame, file in zip(footage.frames, footage.files, strict=True)}
    return _chosen(named, [(frame, key(parts), parts) for frame, parts in clip.items()], key)


def _by_number(named: dict[int, Parts], footage: Footage) -> _Pairing:
    """Match by the last number in the name, from 0 if the clip counts from 1."""
    folder = _parts(str(footage.path))
    folder = (*folder[:-1], "") if footage.is_video or not footage.path.is_dir() else (*folder, "")
    named_as = dict(zip(footage.frames, footage.file_numbers, strict=True))
    wanted = [(frame, str(named_as[frame]), folder) for frame in footage.frames]
    plain = _chosen(named, wanted, _number)
    plain.note = "images are matched by the number in their names: they are the clip's frames of that number"
    if not any(_number(parts) == "0" for parts in named.values()):
        return plain
    moved = _chosen(named, [(frame, str(named_as[frame] - 1), folder) for frame in footage.frames], _number)
    moved.note = "the model counts its images from 0, the clip its frames from 1"
    if footage.is_video or (footage.frames[0] == 1 and len(moved.frames) > len(plain.frames)):
        return moved
    return plain


def _number(parts: Parts) -> str:
    digits = re.findall(r"\d+", _stem(parts))
    return digits[-1].lstrip("0") or "0" if digits else ""


def _chosen(
    named: dict[int, Parts], wanted: Sequence[tuple[int, str, Parts]], key: Callable[[Parts], str]
) -> _Pairing:
    """For each (frame, key, path), choose the image with the key whose folders agree best."""
    by_key: dict[str, list[int]] = defaultdict(list)
    for index, parts in named.items():
        by_key[key(parts)].append(index)
    pairing = _Pairing()
    for frame, value, path in wanted:
        candidates = by_key.get(value, []) if value else []
        agreement = [_shared_folders(named[index], path) for index in candidates]
        most = max(agreement, default=0)
        best = [index for index, shared in zip(candidates, agreement, strict=True) if shared == most]
        if len(best) > 1:
            first, second = ("/".join(named[index]) for index in best[:2])
            pairing.doubtful.append((first, second, frame))
        elif best:
            pairing.frames[best[0]] = frame
    return pairing


def _shared_folders(one: Parts, other: Parts) -> int:
    pairs = list(zip(reversed(one[:-1]), reversed(other[:-1]), strict=False))
    return next((count for count, (a, b) in enumerate(pairs) if a != b), len(pairs))


def _natural(name: str) -> list[tuple[bool, int, str]]:
    """Return a sort key that puts img2 before img10; empty names keep their order."""
    pieces = re.split(r"(\d{1,18})", name)
    return [(piece.isdecimal(), int(piece) if piece.isdecimal() else 0, piece) for piece in pieces if piece]


def _shown(model: Imported, index: int) -> str:
    return model.names[index] or f"camera {index}"


def _some(names: list[str]) -> str:
    return ", ".join(name[-60:] for name in names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")


def _fitted(model: Reconstruction, footage: Footage) -> tuple[Reconstruction, list[str]]:
    """Scale a model to the clip's size, with only those lenses that are used."""
    used = sorted({image.camera for image in model.images})
    places = {camera: place for place, camera in enumerate(used)}
    size = np.array([footage.width, footage.height])
    scales = {camera: size / [model.cameras[camera].width, model.cameras[camera].height] for camera in used}
    for camera in used:
        _check_shape(model.cameras[camera], footage)

    def fitted(image: Image) -> Image:
        return replace(image, xy=image.xy * scales[image.camera], camera=places[image.camera])

    lenses = tuple(model.cameras[camera].scaled(footage.width, footage.height) for camera in used)
    typical = float(np.mean([scales[image.camera] for image in model.images]))
    points = replace(model.points, error=model.points.error * typical)
    sizes = sorted({(model.cameras[c].width, model.cameras[c].height) for c in used})
    other = [f"{w}x{h}" for w, h in sizes if (w, h) != (footage.width, footage.height)]
    notes = [f"the model was solved at {_some(other)} and is scaled to the clip's size"] if other else []
    return Reconstruction(lenses, tuple(map(fitted, model.images)), points), notes


def _check_shape(camera: Intrinsics, footage: Footage) -> None:
    scaled = camera.scaled(footage.width, footage.height)
    across, down = footage.width / camera.width, footage.height / camera.height
    squares_pixels = abs(scaled.fx / scaled.fy - 1) < SAME_ASPECT < abs(camera.fx / camera.fy - 1)
    if abs(across / down - 1) < SAME_ASPECT or squares_pixels:
        return
    turned = (camera.width > camera.height) != (footage.width > footage.height)
    hint = " (one of them lies on its side)" if turned else ""
    raise UserError(
        f"the model was solved from pictures of {camera.width}x{camera.height}, {footage.path.name} has"
        f" {footage.width}x{footage.height}{hint}; give the footage that was solved"
    )


def at_one_place(model: Reconstruction) -> bool:
    """Return whether all cameras share one position, so that points have no depth."""
    centres = np.array([image.centre for image in model.images])
    if len(centres) < 2 or not len(model.points):
        return False
    spread = np.linalg.norm(centres - centres.mean(axis=0), axis=1).max()
    typical = np.median(np.linalg.norm(model.points.xyz - centres.mean(axis=0), axis=1))
    return bool(spread < NO_PATH * typical)
