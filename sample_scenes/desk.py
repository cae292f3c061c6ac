"""A globe on a long table in a living room, seen by a hand-held camera with everything sharp.

Near: a mug of pencils at 1.2 m. The subject: the globe at 2 m. Behind it: books and an alarm clock, a
chair and a plant, and a bookcase, pictures and small lamps along the wall at 7 m. The surfaces are
image textures by seed, with corners to track everywhere.

`python sample_scenes/desk.py --out sample_scenes/desk.mp4` renders the committed clip again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

if __name__ == "__main__" and not __package__:
    # Run as a file: PEP 366, so that the neighbours are imported as the package they are.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "sample_scenes"

from . import clip, props, staging
from .stage import FPS, FRAMES, HEIGHT, WIDTH, Cameras, Floats, Prop, look, tremor

FOCAL = 710.0 / 640
"""Focal length as a fraction of the picture's width: a 40 mm lens on a 36 mm sensor."""
SEED = 20
SUBJECT = np.array(props.GLOBE_CENTRE)
"""Centre of the globe in world coordinates: Blender's axes, z up, metres."""
SUBJECT_RADIUS = props.GLOBE_RADIUS


@dataclass(frozen=True)
class Truth(Cameras):
    """What a reconstruction of the clip should find, in metres and COLMAP's conventions."""

    subject: Floats
    """(3,) centre of the subject in the world."""

    @property
    def subject_depth(self) -> Floats:
        """(N,) depth of the subject's centre in every frame."""
        return self.to_camera(self.subject[None])[:, 0, 2]


def camera_path(frames: int = FRAMES, seed: int = SEED) -> tuple[Floats, Floats]:
    """World-to-camera rotations (N, 3, 3) and translations (N, 3) of a drift to the right by hand.

    Two hands hold a camera to about a degree and a few millimetres; the drift of 13 cm, 6.5 % of the
    subject's distance, is what gives parallax.
    """
    drift = np.linspace(-1, 1, frames)
    sway = tremor(frames, np.random.default_rng(seed))
    centre = np.array([0.0, 0.0, 1.21]) + sway[:, :3] * (0.004, 0.004, 0.004)
    centre[:, 0] += 0.065 * drift
    centre[:, 1] += 0.012 * drift
    centre[:, 2] += 0.010 * np.sin(1.7 * drift)
    # A hand follows the subject, but not all the way: the gaze is a point that lags behind it.
    gaze = np.array([0.02, 2.0, 0.985]) - centre
    gaze[:, 0] += 0.02 * drift
    return look(centre, gaze, sway[:, 3:])


def truth(width: int = WIDTH, height: int = HEIGHT, frames: int = FRAMES, seed: int = SEED) -> Truth:
    """The cameras that `build` films with, for pictures of this size."""
    rotation, translation = camera_path(frames, seed)
    return Truth(width, height, FOCAL * width, rotation, translation, SUBJECT)


def build(
    width: int = WIDTH,
    height: int = HEIGHT,
    frames: int = FRAMES,
    samples: int = 16,
    denoise: bool = True,
    seed: int = SEED,
) -> bpy.types.Scene:
    """Make the furnished scene with its animated camera, ready to render frames 1 ... `frames`.

    The current file's other scenes are left alone. For a lens with depth of field, set
    `scene.camera.data.dof` as usual: it is off. Truth for measuring wants `denoise` off and samples
    in the hundreds; for the eye 16 denoised ones do, and keep the texture.
    """
    scene = bpy.data.scenes.new("desk")
    for prop in props.furnish(seed):
        staging.add(scene, prop, _material(prop))
    _add_lights(scene)
    staging.add_camera(scene, truth(width, height, frames, seed))
    scene.frame_start, scene.frame_end = 1, frames
    staging.set_output(scene, width, height)
    cycles = scene.cycles
    cycles.samples = samples
    cycles.use_denoising = denoise
    if denoise:
        cycles.denoiser, cycles.denoising_prefilter = "OPENIMAGEDENOISE", "FAST"
    cycles.max_bounces = cycles.diffuse_bounces = 3
    cycles.glossy_bounces = 1
    cycles.sample_clamp_indirect = 2.0
    cycles.seed = seed
    cycles.use_animated_seed = True
    # Only the window's scene has its animation evaluated when it renders.
    bpy.context.window.scene = scene
    return scene


def _add_lights(scene: bpy.types.Scene) -> None:
    """A window's light from the left, a weaker one from the right, a glow by the wall, and soft air."""
    world = bpy.data.worlds.new("air")
    world.color = (0.30, 0.30, 0.31)
    scene.world = world
    # name, place, target, width, height, watts, colour
    areas = (
        ("window", (-2.6, 0.2, 2.6), (0.2, 2.2, 0.8), 1.4, 1.4, 150.0, (1.0, 0.96, 0.90)),
        ("bounce", (2.8, 2.6, 2.4), (0.0, 2.4, 0.8), 2.0, 1.5, 36.0, (0.90, 0.95, 1.0)),
        ("ceiling", (0.0, 4.9, 3.4), (0.0, 6.2, 0.9), 3.6, 0.8, 150.0, (1.0, 0.88, 0.72)),
        ("lamp", (1.75, 5.9, 1.75), (1.75, 7.0, 1.5), 0.5, 0.5, 11.0, (1.0, 0.76, 0.48)),
    )
    for name, place, target, width, height, watts, colour in areas:
        light = bpy.data.lights.new(name, "AREA")
        light.shape = "RECTANGLE"
        light.size, light.size_y, light.energy, light.color = width, height, watts, colour
        holder = bpy.data.objects.new(name, light)
        back = -(np.array(target) - place) / np.linalg.norm(np.array(target) - place)
        side = np.cross((0.0, 0.0, 1.0), back)
        side /= np.linalg.norm(side)
        axes = np.stack([side, np.cross(back, side), back], axis=1)
        holder.matrix_world = Matrix.LocRotScale(place, Matrix(axes.tolist()), None)
        scene.collection.objects.link(holder)


def _material(prop: Prop) -> bpy.types.Material:
    material = bpy.data.materials.new(prop.name)
    tree = material.node_tree
    texture = staging.texture_node(material, prop)
    surface = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    if prop.glow:
        surface.inputs["Base Color"].default_value = (0, 0, 0, 1)
        surface.inputs["Emission Strength"].default_value = prop.glow
        tree.links.new(texture.outputs["Color"], surface.inputs["Emission Color"])
    else:
        tree.links.new(texture.outputs["Color"], surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = prop.roughness
    # Weak highlights: those move against the surface, which feature tracking takes for motion.
    surface.inputs["Specular IOR Level"].default_value = 0.25
    return material


def render_frame(scene: bpy.types.Scene, frame: int, out: Path) -> None:
    """Render one frame to the file `out`, in the scene's file format."""
    scene.frame_set(frame)
    scene.render.filepath = str(out.resolve())
    scene.render.use_file_extension = False
    bpy.ops.render.render(write_still=True, scene=scene.name)


def film(out: Path, frames_dir: Path, samples: int = 16, crf: int = 16) -> None:
    """Render every frame to `frames_dir` and write them, with a ticking clock, as the clip `out`."""
    scene = build(samples=samples)
    names = [frames_dir / f"{frame:04d}.png" for frame in range(scene.frame_start, scene.frame_end + 1)]
    for frame, name in enumerate(names, start=scene.frame_start):
        render_frame(scene, frame, name)
    sound = frames_dir / "ticking.wav"
    clip.write_sound(sound, clip.ticking(len(names) / FPS))
    clip.encode(names, out, FPS, sound, crf)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, help="the mp4 to write")
    parser.add_argument("--frames-dir", type=Path, help="keep the rendered PNG files here")
    parser.add_argument("--samples", type=int, default=16, help="Cycles samples per pixel")
    parser.add_argument("--crf", type=int, default=16, help="H.264 rate factor: less is better and larger")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        frames_dir = arguments.frames_dir or Path(scratch)
        frames_dir.mkdir(parents=True, exist_ok=True)
        film(arguments.out, frames_dir, arguments.samples, arguments.crf)
    places = truth()
    x, y = places.project(SUBJECT[None])[0, 0] / (WIDTH, HEIGHT)
    print(f"{arguments.out}: {FRAMES} frames, {arguments.out.stat().st_size / 1e6:.2f} MB")
    print(f"subject at {x:.3f},{y:.3f} of the first frame, {places.subject_depth[0]:.2f} m away")


if __name__ == "__main__":
    main()
