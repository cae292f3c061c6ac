"""Clips that structure from motion is judged by: ways to move a camera, and clips that cannot be solved.

The things are those of the sample scenes; the cameras are new. Lengths are metres, frames count from 0 here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from sample_scenes import blocks, boxes, plain, rack, slope, textures, walk
from sample_scenes.boxes import printed_box
from sample_scenes.shapes import box
from sample_scenes.stage import FPS, HEIGHT, WIDTH, Cameras, Floats, Prop, Stage, handheld, look, tremor
from sample_scenes.textures import Generator, Picture

from .real_lens import RealLens

FRAMES = 48
SEED = 113
FOCAL = 700 / WIDTH
APART = np.array([200.0, 0.0, 0.0])
"""Between the two places of the clip with a cut."""
PAN_FRAMES = 30
HELD_FRAMES = 40
WIDE = (WIDTH + 96, HEIGHT + 54)
"""Pixels of the pinhole from whose picture a real camera's is taken."""
REAL = RealLens(WIDTH, HEIGHT)
BENT = RealLens(WIDTH, HEIGHT, distortion=0.03)
ACTION = RealLens(WIDTH, HEIGHT, k1=-0.3)
PHONE = RealLens(WIDTH, HEIGHT, k1=0.03)
ROLLING = RealLens(WIDTH, HEIGHT, readout=0.020 * FPS)
WIDER = (WIDTH + 160, HEIGHT + 90)
"""The same for an action camera, whose corner is 22 % nearer to the middle than a pinhole's."""
ACTION_FOCAL = 0.9 * WIDTH
"""Pixels: with a shorter one the polynomial folds before the corner."""
SLOW_ZOOM = FOCAL * WIDTH * np.linspace(0.95, 1.05, PAN_FRAMES)
ONE_PER_CENT = 0.01 * WIDTH / (FOCAL * WIDTH) / (1 / 1.2 - 1 / 7.5)
"""Metres of path for which what is at 1.2 m and at 7.5 m move by 1 % of the width past each other."""


@dataclass(frozen=True)
class Motion:
    """A clip to be solved, and what is to come of it."""

    stage: Stage
    focals: Floats
    """(N,) focal length in pixels of each frame."""
    refusal: str = ""
    """A regular expression that a refusal's message must contain; empty where the clip has a solution."""
    optional: bool = False
    """A right solution is as good as the refusal."""
    lens: RealLens | None = None
    """What films the clip, `stage` having a wider pinhole; None is the stage's pinhole itself."""

    @property
    def name(self) -> str:
        return self.stage.name

    @property
    def has_one_focal(self) -> bool:
        return bool(np.ptp(self.focals) == 0)

    @property
    def cameras(self) -> Cameras:
        return self.stage.cameras


def _motion(
    name: str,
    title: str,
    things: Sequence[Prop],
    cameras: Cameras,
    refusal: str = "",
    focals: Floats | None = None,
    optional: bool = False,
) -> Motion:
    """Things and cameras as a motion; the stage's focus plays no part."""
    frames = len(cameras)
    # Some things stand still by a list of their stage's own length.
    things = [
        thing if thing.travel is None or len(thing.travel) == frames
        else replace(thing, travel=np.zeros((frames, 3)))
        for thing in things
    ]  # fmt: skip
    stage = Stage(
        name, title, cameras, tuple(things), np.zeros((frames, 3)), air=(0.2, 0.2, 0.2), sun=(-0.4, -0.7, 0.6)
    )
    if focals is None:
        focals = np.full(frames, cameras.focal)
    return Motion(stage, focals, refusal, optional)


def _hand(
    centre: Floats, target: Floats, seed: int, shake: float = 0.004, focal: float = FOCAL,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> Cameras:  # fmt: skip
    """Cameras along `centre` (N, 3) that look at `target` (N, 3), trembling as a hand does."""
    sway = tremor(len(centre), np.random.default_rng(seed))
    centre = centre + shake * sway[:, :3]
    rotation, translation = look(centre, target - centre, sway[:, 3:])
    return Cameras(*size, focal * size[0], rotation, translation)


def _still(place: ArrayLike) -> Floats:
    return np.tile(np.asarray(place, dtype=np.float64), (FRAMES, 1))


# The eight motions


def sideways() -> Motion:
    cameras = handheld(
        (-0.16, 0, 1.23), (0.16, 0.02, 1.21), (0.02, 2.5, 1.10), (0.05, 2.5, 1.10), rack.FOCAL, SEED, FRAMES
    )
    return _motion("sideways", "0.32 m sideways before things at 1.2 to 7.5 m", rack.stage().things, cameras)


def ahead() -> Motion:
    target = (0.1, walk.BACK, 1.02)
    start, end = (0.1, 0, walk.EYE), (0.1, walk.STEPS, walk.EYE)
    cameras = handheld(start, end, target, target, walk.FOCAL, SEED + 1, FRAMES, shake=0.006)
    return _motion("ahead", "0.9 m straight ahead through a room of 8.6 m", walk.stage().things, cameras)


def rail() -> Motion:
    """The same without a hand's trembling, along the gaze: every focal length explains it."""
    centre = np.linspace((0.1, 0, walk.EYE), (0.1, walk.STEPS, walk.EYE), FRAMES)
    rotation, translation = look(centre, np.tile([0.0, 1.0, 0.0], (FRAMES, 1)), np.zeros((FRAMES, 3)))
    cameras = Cameras(WIDTH, HEIGHT, walk.FOCAL * WIDTH, rotation, translation)
    title = "0.9 m straight ahead on a rail: the focal length cannot be known"
    return _motion("rail", title, walk.stage().things, cameras)


def orbit() -> Motion:
    pivot = np.array([0.10, 2.75, 0.25])
    angle = np.radians(np.linspace(-11, 11, FRAMES))
    arm = 2.6 * np.stack([np.sin(angle), -np.cos(angle), 0 * angle], axis=1)
    centre = pivot + arm + [0, 0, 0.42]
    cameras = _hand(centre, np.tile(pivot, (FRAMES, 1)), SEED + 2, focal=blocks.FOCAL)
    return _motion("orbit", "22 degrees around blocks at 1.7 to 4 m", blocks.stage().things, cameras)


def jitter() -> Motion:
    """The lab without what stands near: floor, walls and ceiling begin at about 4 m."""
    things = [thing for thing in walk.stage().things if thing.layer < 3]
    cameras = _hand(_still((0.1, 0, walk.EYE)), _still((0.1, walk.BACK, 1.10)), SEED + 3, shake=0.005)
    return _motion("jitter", "a hand that only trembles, 5 mm, before things at 4 to 8.6 m", things, cameras)


def planar() -> Motion:
    cameras = handheld(
        (-0.3, 0, 1.5), (0.3, 0.1, 1.45), (-0.1, 3, 1.5), (0.1, 3, 1.5), FOCAL, SEED + 4, FRAMES
    )
    things = _poster_wall(np.random.default_rng(SEED))
    return _motion("planar", "0.6 m along a wall of pictures 3 m away, 6 cm of relief", things, cameras)


def weak() -> Motion:
    ahead = (0.02, 2.0, plain.TABLE + 0.20)
    cameras = handheld((-0.12, 0, 1.12), (0.12, 0.02, 1.14), ahead, ahead, plain.FOCAL, SEED + 5, FRAMES)
    rng = np.random.default_rng(SEED)
    things = [replace(thing, picture=_grained(rng, thing.picture)) for thing in plain.stage().things]
    title = (
        "0.24 m sideways before plainly painted things at 1.4 to 3.8 m, a grain of 4 grey levels in the paint"
    )
    return _motion("weak", title, things, cameras)


def small() -> Motion:
    share = np.linspace(-1, 1, FRAMES)[:, None]
    centre = boxes.PIVOT + [0, -boxes.REACH, boxes.RISE] + share * [0.08, 0.0, -0.01]
    cameras = _hand(centre, _still(boxes.PIVOT), SEED + 6, 0.002, focal=1.1, size=(320, 240))
    title = "320x240, 0.16 m sideways before a table laid from 0.5 to 1.7 m and a room"
    return _motion("small", title, boxes.stage().things, cameras)


def moving_object() -> Motion:
    """The room of the racked focus without its nearest subject; a printed crate crosses it."""
    things = [thing for thing in rack.stage().things if thing.layer < 4]
    cameras = handheld(
        (-0.2, 0, 1.25), (0.2, 0.05, 1.22), (0.0, 4.0, 1.15), (0.05, 4.0, 1.15), FOCAL, SEED + 7, FRAMES
    )
    title = "0.4 m sideways, a crate of 30 % of the frame goes its own way"
    return _motion("moving_object", title, [*things, _crate(np.random.default_rng(SEED))], cameras)


def _grained(rng: Generator, picture: Picture) -> Picture:
    """The picture with a faint unevenness of a few pixels, as of plaster."""
    height, width = picture.shape[:2]
    grain = textures.noise(rng, (height, width), (height / 4, width / 4), 2)
    return picture * (1 + np.float32(0.08) * (grain - np.float32(0.5)))[..., None]


def _poster_wall(rng: Generator) -> list[Prop]:
    """Prints beside and above each other on panels of 0 to 6 cm on a brick wall."""
    paper = walk.bricks(rng, (384, 704), 30, 22, (0.78, 0.52, 0.40))
    props = [Prop("wall", box((6.0, 0.1, 3.4)).moved(0, 3.05, 0), paper)]
    paints = (slope.poster, textures.postcard, textures.landscape)
    for row, (z, tall) in enumerate(((0.55, 0.55), (1.2, 0.6), (1.9, 0.55))):
        for column, x in enumerate(np.linspace(-1.9, 1.9, 6)):
            wide, thick = rng.uniform(0.42, 0.6), rng.uniform(0.005, 0.06)
            paint = paints[(row + column) % 3](rng, (round(260 * tall), round(260 * wide)))
            panel = box((wide, thick, tall)).moved(x, 3 - thick / 2, z + rng.uniform(-0.03, 0.03))
            props.append(Prop(f"print {row} {column}", panel, np.asarray(paint, np.float32)))
    return props


def _crate(rng: Generator) -> Prop:
    """A cube of 0.72 m with prints on all sides that sways before the camera at about 2 m.

    One that glided evenly beside an evenly walking camera would be a smaller thing that stands still, nearer.
    """
    shape = printed_box((0.72, 0.72, 0.72)).turned(28).moved(0.0, 2.3, 0.82)
    sheet = np.concatenate(
        [np.concatenate([slope.poster(rng, (200, 200)) for _ in range(2)], axis=1) for _ in range(2)]
    )
    turn = 1.5 * np.pi * np.linspace(-1, 1, FRAMES)
    travel = np.stack([-0.24 * np.sin(turn), 0.10 * np.cos(0.8 * turn), 0.06 * np.sin(1.3 * turn)], axis=1)
    return Prop("crate", shape, np.asarray(sheet, np.float32), layer=5, travel=travel)


# What must be refused, or solved by what we do not ask for


def pan() -> Motion:
    sway = tremor(FRAMES, np.random.default_rng(SEED + 8))
    yaw = np.radians(np.linspace(-8, 8, FRAMES))
    gaze = np.stack([np.sin(yaw), np.cos(yaw), np.full(FRAMES, -0.04)], axis=1)
    centre = _still((0, 0, 1.22))
    rotation, translation = look(centre, gaze, sway[:, 3:])
    cameras = Cameras(WIDTH, HEIGHT, FOCAL * WIDTH, rotation, translation)
    return _motion("pan", "16 degrees on a tripod", rack.stage().things, cameras, refusal="turns|rotat|pan")


def static() -> Motion:
    place, target = _still((0, 0, 1.22)), _still((0.03, 2.5, 1.1))
    rotation, translation = look(place, target - place, np.zeros((FRAMES, 3)))
    cameras = Cameras(WIDTH, HEIGHT, FOCAL * WIDTH, rotation, translation)
    title = "a camera that stands still, only its noise moves"
    return _motion("static", title, rack.stage().things, cameras, refusal="does not move|stands still|static")


def textureless() -> Motion:
    cameras = handheld((-0.2, 0, 1.2), (0.2, 0, 1.2), (0, 3, 1.2), (0, 3, 1.2), FOCAL, SEED + 9, FRAMES)
    tone = np.linspace(0.45, 0.6, 32, dtype=np.float32)[:, None, None]
    wall = Prop("wall", box((8.0, 0.1, 5.0)).moved(0, 3.05, -1.3), np.ones((32, 32, 3), np.float32) * tone)
    title = "0.4 m sideways before an evenly painted wall"
    return _motion("textureless", title, [wall], cameras, refusal="texture|features")


def cut() -> Motion:
    """Half the frames in one place, half in another: the second is built far beside the first."""
    first = handheld(
        (-0.1, 0, 1.23), (0.1, 0.02, 1.21), (0, 2.5, 1.1), (0, 2.5, 1.1), FOCAL, SEED, FRAMES // 2
    )
    second = handheld(
        (-0.2, 0, 1.62), (0.2, 0.06, 1.59), (0.0, 4.6, 0.78), (0.1, 4.6, 0.8), FOCAL, SEED + 1, FRAMES // 2
    )
    there = [replace(t, shape=t.shape.moved(*APART)) for t in slope.stage().things]
    rotation = np.concatenate([first.rotation, second.rotation])
    centres = np.concatenate([first.centres, second.centres + APART])
    translation = -np.einsum("nij,nj->ni", rotation, centres)
    cameras = Cameras(WIDTH, HEIGHT, FOCAL * WIDTH, rotation, translation)
    title = "two shots of 24 frames each, 0.2 and 0.4 m sideways"
    return _motion("cut", title, [*rack.stage().things, *there], cameras, refusal="cut|shots")


def zoom() -> Motion:
    shot = handheld(
        (-0.16, 0, 1.23), (0.16, 0.02, 1.21), (0.02, 2.5, 1.10), (0.05, 2.5, 1.10), FOCAL, SEED + 10, FRAMES
    )
    share = np.linspace(0, 1, FRAMES)
    focals = 600 * (900 / 600) ** (share**2 * (3 - 2 * share))
    title = "0.32 m sideways while the lens zooms from 600 to 900 px"
    return _motion(
        "zoom", title, rack.stage().things, shot, refusal="zoom|focal length changes", focals=focals,
        optional=True,
    )  # fmt: skip


# Pans as real cameras take them


def _pan(
    name: str,
    title: str,
    path: float = 0.0,
    arm: float = 0.0,
    lens: RealLens = REAL,
    focals: Floats | None = None,
    refusal: str = "turns|pan",
) -> Motion:
    """A head that turns by 20 degrees, slowly, fast and slowly again, while it slides `path` metres to the
    side; the lens is `arm` metres ahead of its axis."""
    share = (1 - np.cos(np.pi * np.linspace(0, 1, PAN_FRAMES))) / 2
    yaw = np.radians(20) * (share - 0.5)
    gaze = np.stack([np.sin(yaw), np.cos(yaw), np.full(PAN_FRAMES, -0.04)], axis=1)
    level = gaze * [1, 1, 0] / np.linalg.norm(gaze[:, :2], axis=1, keepdims=True)
    centre = np.array([0, 0, 1.22]) + arm * level + path * (share - 0.5)[:, None] * [1, 0, 0]
    sway = tremor(PAN_FRAMES, np.random.default_rng(SEED + 11))
    rotation, translation = look(centre, gaze, sway[:, 3:])
    cameras = Cameras(*WIDE, FOCAL * WIDTH, rotation, translation)
    made = _motion(name, title, rack.stage().things, cameras, refusal, focals)
    return replace(made, lens=lens)


def pan_distorted() -> Motion:
    return _pan("pan_distorted", "a pan of 20 degrees through a lens with 3 % of distortion", lens=BENT)


def pan_distorted_parallax() -> Motion:
    title = "the same with 1 % of the width as parallax"
    return _pan("pan_distorted_parallax", title, ONE_PER_CENT, lens=BENT, refusal="")


def pan_rolling() -> Motion:
    return _pan("pan_rolling", "a pan of 20 degrees whose rows are read in 20 ms", lens=ROLLING)


def pan_rolling_parallax() -> Motion:
    title = "the same with 1 % of the width as parallax"
    return _pan("pan_rolling_parallax", title, ONE_PER_CENT, lens=ROLLING, refusal="")


def pan_zoom() -> Motion:
    return _pan("pan_zoom", "a pan of 20 degrees while the lens zooms by 10 %", focals=SLOW_ZOOM)


def pan_zoom_parallax() -> Motion:
    title = "the same with 1 % of the width as parallax"
    return _pan("pan_zoom_parallax", title, ONE_PER_CENT, focals=SLOW_ZOOM, refusal="")


def tripod() -> Motion:
    title = "a pan of 20 degrees, the lens 10 cm ahead of the axis: 3.5 cm of path"
    return _pan("tripod", title, arm=0.1, refusal="")


def tripod_parallax() -> Motion:
    return _pan(
        "tripod_parallax", "the same with 1 % of the width as parallax", ONE_PER_CENT, 0.1, refusal=""
    )


# Hands that hold real cameras


def _held(name: str, title: str, lens: RealLens, focal: float = FOCAL * WIDTH, turns: float = 1.0) -> Motion:
    """0.4 m by hand before things at 1.2 to 7.5 m, the gaze wandering by 10 degrees, through a lens; the hand
    turns `turns` times as far as one usually does."""
    share = np.linspace(0, 1, HELD_FRAMES)[:, None]
    sway = tremor(HELD_FRAMES, np.random.default_rng(SEED + 12))
    centre = (1 - share) * [-0.2, 0, 1.23] + share * [0.2, 0.05, 1.20] + 0.006 * sway[:, :3]
    target = (1 - share) * [-0.2, 2.5, 1.05] + share * [0.25, 2.5, 1.15]
    rotation, translation = look(centre, target - centre, turns * sway[:, 3:])
    cameras = Cameras(*WIDER, focal, rotation, translation)
    return replace(_motion(name, title, rack.stage().things, cameras), lens=lens)


def held_action() -> Motion:
    title = "0.4 m by hand through an action camera's lens, k1 -0.3"
    return _held("held_action", title, ACTION, ACTION_FOCAL)


def held_phone() -> Motion:
    return _held("held_phone", "the same through a phone's, k1 0.03", PHONE)


def held_rolling() -> Motion:
    title = "the same with rows that are read in 20 ms, and a hand that shakes more"
    return _held("held_rolling", title, ROLLING, turns=3.0)


MOTIONS: dict[str, Callable[[], Motion]] = {
    made.__name__: made
    for made in (
        sideways, ahead, orbit, jitter, planar, weak, small, moving_object, rail, pan, static, textureless,
        cut, zoom, pan_distorted, pan_distorted_parallax, pan_rolling, pan_rolling_parallax, pan_zoom,
        pan_zoom_parallax, tripod, tripod_parallax, held_action, held_phone, held_rolling,
    )
}  # fmt: skip
