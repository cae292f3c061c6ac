"""Solves of other programs: real ones, and small ones of which every number is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from addon.core.media.clip import Footage, open_footage
from addon.core.readers import bundler, nvm, read_reconstruction, voodoo
from addon.core.readers.matching import ONLY_TURNS, Imported, match

from .. import foreign_models as foreign
from ..foreign_models import LENS, NAMES, SIZE, world


def put(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def misses(model: Reconstruction) -> np.ndarray:
    """Distances in pixels between all features and where their points project."""
    found = []
    for image in model.images:
        place = model.intrinsics(image).project(image.to_camera(model.points.xyz[image.points]))
        found.append(np.linalg.norm(place - image.xy, axis=1))
    return np.concatenate(found)


def same(found: Reconstruction, wanted: Reconstruction, atol: float = 1e-9) -> None:
    """Poses, lenses, points and features agree; frames may not."""
    np.testing.assert_allclose(found.points.xyz, wanted.points.xyz, atol=atol)
    assert len(found.images) == len(wanted.images)
    for one, other in zip(found.images, wanted.images, strict=True):
        np.testing.assert_allclose(one.rotation, other.rotation, atol=atol)
        np.testing.assert_allclose(one.translation, other.translation, atol=atol)
        order = np.argsort(one.points)
        np.testing.assert_array_equal(one.points[order], other.points)
        np.testing.assert_allclose(one.xy[order], other.xy, atol=1e3 * atol)
        mine, theirs = found.intrinsics(one), wanted.intrinsics(other)
        assert mine.parameters()[1] == pytest.approx(theirs.parameters()[1], abs=1e-6)


# Real files.


def test_kermit_agrees_with_bundlers_formulas(data: Path) -> None:
    """Every observation reprojects as the manual's formulas say, computed here from the bare numbers."""
    folder = data / "kermit"
    imported = read_reconstruction(folder / "bundle.out", open_footage(folder))
    model = imported.reconstruction
    assert imported.format == "Bundler v0.3"
    assert model.frames.tolist() == [0, 1, 2, 3, 5, 7, 8, 9, 10]
    assert any("2 frames of the clip have no camera: 4, 6" in note for note in imported.notes)
    images = {int(image.frame): image for image in model.images}

    words = (folder / "bundle.out").read_text().split("\n", 1)[1].split()
    cameras, points = int(words[0]), int(words[1])
    numbers = list(map(float, words[2:]))
    at, seen, largest, errors = 15 * cameras, 0, 0.0, []
    for point in range(points):
        xyz = np.array(numbers[at : at + 3])
        for view in range(int(numbers[at + 6])):
            camera, _, x, y = numbers[at + 7 + 4 * view : at + 11 + 4 * view]
            focal, k1, k2, *pose = numbers[15 * int(camera) : 15 * int(camera) + 15]
            local = np.array(pose[:9]).reshape(3, 3) @ xyz + pose[9:]
            p = -local[:2] / local[2]
            square = p @ p
            theirs = focal * (1 + k1 * square + k2 * square**2) * p
            image = images[int(camera)]
            row = int(np.flatnonzero(image.points == point)[0])
            ours = model.intrinsics(image).project(image.to_camera(model.points.xyz[point]))
            np.testing.assert_allclose(image.xy[row], [320 + x, 240 - y], atol=1e-9)
            largest = max(largest, float(np.abs(ours - [320 + theirs[0], 240 - theirs[1]]).max()))
            errors.append(np.linalg.norm(theirs - [x, y]))
            seen += 1
        at += 7 + 4 * int(numbers[at + 6])
    assert sum(len(image.points) for image in model.images) == seen
    assert largest < 0.01
    median = float(np.median(errors))
    assert 0.05 < median < 0.5
    print(
        f"\nkermit: {seen} features, reprojection differs by {largest:.1e} px, median error {median:.3f} px"
    )


def test_voodoo_agrees_with_its_headers_formula(data: Path) -> None:
    folder = data / "voodoo"
    imported = read_reconstruction(folder / "3d_tracking.txt", open_footage(folder))
    model = imported.reconstruction
    assert model.frames.tolist() == [0, 13, 26, 39, 52, 65, 78, 91, 104, 117]
    assert len(model.points) == 2203
    assert ONLY_TURNS in imported.notes
    lines = (folder / "3d_tracking.txt").read_text().splitlines()
    rows = [line for line in lines if line and not line.startswith("#")]
    largest = 0.0
    for image in model.images:
        values = np.array(rows[image.frame].split(), dtype=float)
        from_centre = model.points.xyz[image.points] - values[:3]
        depth = from_centre @ values[3:6]
        x = from_centre @ values[6:9] / depth + 0.5 * (values[16] - 1)
        y = from_centre @ values[9:12] / depth + 0.5 * (values[17] - 1)
        # Its first pixel's centre is at 0, ours at a half.
        largest = max(largest, float(np.abs(image.xy - np.stack([x, y], axis=1) - 0.5).max()))
        camera = model.intrinsics(image)
        assert camera.fy / camera.fx == pytest.approx(values[14] / values[15], abs=1e-8)
        assert camera.fx == pytest.approx(values[20] / values[14], abs=1e-4)
    assert largest < 0.01
    print(f"\nvoodoo: {sum(len(i.points) for i in model.images)} places, largest difference {largest:.1e} px")


# Bundler.

DISTORTED = replace(LENS, k1=-0.05, k2=0.01)


def test_bundler_is_read_as_it_was_written(tmp_path: Path) -> None:
    wanted = world(DISTORTED)
    found = bundler.read(put(tmp_path, "bundle.out", foreign.bundler(wanted)), SIZE)
    same(found.reconstruction, wanted)
    np.testing.assert_array_equal(found.reconstruction.points.rgb, wanted.points.rgb)
    assert found.names == ("",) * 4
    assert misses(found.reconstruction).max() < 1e-9
    assert found.reconstruction.points.error.max() < 1e-9


@pytest.mark.parametrize("ends", ["\r\n", "\r", " \n\n"])
def test_bundler_is_a_stream_of_words(tmp_path: Path, ends: str) -> None:
    """Line ends of any system, breaks anywhere, a byte order mark."""
    wanted = world(DISTORTED)
    for header in ("# Bundle file v0.3\n", "v0.3\n", "\ufeff# Bundle file v0.3\n"):
        text = header + foreign.bundler(wanted, "").replace("\n", ends)
        path = put(tmp_path, "bundle.out", text)
        assert bundler.recognises(path)
        same(bundler.read(path, SIZE).reconstruction, wanted)
    head, body = foreign.bundler(wanted, "").split("\n", 1)
    wrapped = put(tmp_path, "bundle.out", f"v0.3\n{head}\n" + "\n".join(body.split()))
    same(bundler.read(wrapped, SIZE).reconstruction, wanted)


def test_features_of_cameras_without_a_pose_and_repeated_ones_are_left_out(tmp_path: Path) -> None:
    wanted = world()
    lines = foreign.bundler(wanted).split("\n")
    lines[7:12] = ["0 0 0"] * 5
    # The first point's last view once more, somewhere else.
    count, *rest = lines[24].split()
    lines[24] = " ".join([str(int(count) + 1), *rest, rest[-4], "8", "0.0", "0.0"])
    found = bundler.read(put(tmp_path, "bundle.out", "\n".join(lines)), SIZE)
    left = tuple(image for image in wanted.images if image.frame != 1)
    lenses = (LENS,)
    same(found.reconstruction, Reconstruction(lenses, left, wanted.points))
    assert any("11 features belong to cameras that are not registered" in note for note in found.notes)


@pytest.mark.parametrize("where", ["list.txt", "bundle.out.list.txt", "../list.txt"])
def test_bundler_reads_the_list_of_pictures(tmp_path: Path, where: str) -> None:
    wanted = world()
    folder = tmp_path / "bundle"
    folder.mkdir()
    path = put(folder, "bundle.out", foreign.bundler(wanted))
    lines = [
        "./my pictures/shot_0004.png 0 1234.5",
        "shot_0003.png",
        "a/shot_0002.png 0 80",
        "shot_0001.png",
        "",
    ]
    put(folder, where, "\r\n".join(lines))
    found = bundler.read(path, SIZE)
    assert found.names == ("./my pictures/shot_0004.png", "shot_0003.png", "a/shot_0002.png", "shot_0001.png")
    imported = match(found, foreign.footage())
    assert imported.reconstruction.frames.tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(imported.reconstruction.images[0].centre, wanted.images[3].centre, atol=1e-9)
    put(folder, where, "\n".join(lines[:3]))
    with pytest.raises(UserError, match=r"names 3 pictures, bundle\.out has 4 cameras"):
        bundler.read(path, SIZE)


def test_bundler_takes_the_size_from_a_picture_beside_it(tmp_path: Path) -> None:
    """The clip is half as large as the pictures that were solved: the model is scaled, not misread."""
    wanted = world()
    put(tmp_path, "bundle.out", foreign.bundler(wanted))
    put(tmp_path, "list.txt", "\n".join(NAMES))
    cv2.imwrite(str(tmp_path / NAMES[1]), np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    imported = read_reconstruction(tmp_path, foreign.footage(size=(48, 32)))
    camera = imported.reconstruction.cameras[0]
    assert (camera.width, camera.height, camera.fx, camera.cx, camera.cy) == (48, 32, 40.0, 24.0, 16.0)
    assert misses(imported.reconstruction).max() < 1e-9
    assert any("was solved at 96x64" in note for note in imported.notes)


def test_features_outside_the_picture_tell_of_other_footage(tmp_path: Path) -> None:
    path = put(tmp_path, "bundle.out", foreign.bundler(world()))
    with pytest.raises(UserError, match="not solved from pictures of 32x20"):
        bundler.read(path, (32, 20))
    found = bundler.read(path, (1000, 800))
    assert any("if smaller pictures" in note for note in found.notes)


# VisualSFM.


@pytest.mark.parametrize("origin", [(0.0, 0.0), (48.0, 32.0)])
@pytest.mark.parametrize("header", ["NVM_V3\n\n", "NVM_V3 \n \n"])
def test_nvm_is_read_as_it_was_written(tmp_path: Path, header: str, origin: tuple[float, float]) -> None:
    """From the picture's centre as VisualSFM writes, or in absolute pixels as COLMAP does."""
    wanted = world()
    path = put(tmp_path, "a.nvm", foreign.nvm(wanted, header=header, origin=origin))
    found = nvm.read(path, SIZE)
    same(found.reconstruction, wanted)
    assert found.names == NAMES
    assert any("absolute pixels" in note for note in found.notes) == (origin == (0.0, 0.0))


@pytest.mark.parametrize("radial", [0.17, -0.15])
def test_nvms_radial_parameter_undistorts(tmp_path: Path, radial: float) -> None:
    """VisualSFM's features are where x_u = x_d (1 + r x_d^2) says; our lens agrees to 0.01 pixels."""
    camera = Intrinsics(2832, 2128, 2975.0, 2975.0, 1416.0, 1064.0)
    wanted = world(camera)
    images = []
    for image in wanted.images:
        true = (image.xy - camera.principal_point) / camera.focal
        seen = true.copy()
        for _ in range(100):
            square = (seen * seen).sum(axis=1, keepdims=True)
            seen -= (seen * (1 + radial * square) - true) / (1 + 3 * radial * square)
        assert np.abs(seen).max() > 0.3
        images.append(replace(image, xy=seen * camera.focal + camera.principal_point))
    text = foreign.nvm(replace(wanted, images=tuple(images)), radial=radial, origin=(1416.0, 1064.0))
    found = nvm.read(put(tmp_path, "a.nvm", text), (2832, 2128))
    assert misses(found.reconstruction).max() < 0.01
    assert not any("distortion" in note for note in found.notes)


def test_nvms_radial_parameter_is_colmaps_in_absolute_pixels(tmp_path: Path) -> None:
    wanted = world(replace(LENS, k1=-0.2))
    found = nvm.read(put(tmp_path, "a.nvm", foreign.nvm(wanted, radial=0.2)), SIZE)
    same(found.reconstruction, wanted)
    assert found.reconstruction.cameras[0].k1 == -0.2


def test_nvm_with_a_fixed_calibration(tmp_path: Path) -> None:
    lens = replace(LENS, fy=76.0, cx=51.0, cy=30.0)
    wanted = world(lens)
    for header in ("NVM_V3 FixedK 80 51 76 30 0\n", "NVM_V3\nFixedK 80 51 76 30\n"):
        text = foreign.nvm(wanted, header=header, origin=(51.0, 30.0))
        same(nvm.read(put(tmp_path, "a.nvm", text), SIZE).reconstruction, wanted)


def test_nvm_names_have_spaces_and_quotation_marks(tmp_path: Path) -> None:
    names = (
        "my shots/shot 1.png",
        '"my shots/shot 2.png"',
        'my"shots/shot"3.png',
        "C:\\my shots\\shot 4.png",
    )
    text = foreign.nvm(world(), names)
    found = nvm.read(put(tmp_path, "a.nvm", text), SIZE)
    assert found.names == ("my shots/shot 1.png", "my shots/shot 2.png", "my shots/shot 3.png", names[3])
    spaces = nvm.read(put(tmp_path, "a.nvm", text.replace("\t", " ")), SIZE)
    assert spaces.names == found.names


def test_nvm_of_several_models_gives_the_largest(tmp_path: Path) -> None:
    small = foreign.nvm(world(images=2), ("x.png", "y.png"), tail="\n\n")
    large = foreign.nvm(world(), header="", tail="\n\n")
    end = "0\n#the last part of NVM file points to the PLY files\n1 0\n"
    other = foreign.nvm(world(images=2), ("x.png", "y.png"), header="", tail="\n\n")
    found = nvm.read(put(tmp_path, "a.nvm", small + large + other + end), SIZE)
    same(found.reconstruction, world())
    assert found.names == NAMES
    assert any("has 3 models" in note and "4 cameras" in note for note in found.notes)


def test_nvm_that_does_not_reproject_is_of_other_footage(tmp_path: Path) -> None:
    wanted = world(replace(LENS, k1=0.0))
    swapped = replace(wanted, images=tuple(replace(i, xy=i.xy[::-1] * [1, 0.3]) for i in wanted.images))
    with pytest.raises(UserError, match="give the footage that was solved"):
        nvm.read(put(tmp_path, "a.nvm", foreign.nvm(swapped)), SIZE)


# Voodoo.


def test_voodoo_is_read_as_it_was_written(tmp_path: Path) -> None:
    lens = replace(LENS, fy=90.0, cx=50.5, cy=31.0)
    wanted = world(lens)
    found = voodoo.read(put(tmp_path, "a.txt", foreign.voodoo(wanted)), SIZE)
    assert len(found.reconstruction.cameras) == 1
    assert found.reconstruction.cameras[0].parameters()[1] == pytest.approx((80.0, 90.0, 50.5, 31.0))
    np.testing.assert_allclose(found.reconstruction.points.xyz, wanted.points.xyz)
    for one, other in zip(found.reconstruction.images, wanted.images, strict=True):
        np.testing.assert_allclose(one.centre, other.centre, atol=1e-12)
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-12)
        inside = np.isin(one.points, other.points)
        np.testing.assert_allclose(one.xy[inside], other.xy[np.isin(other.points, one.points)], atol=1e-9)
    assert any("no 2D tracks" in note for note in found.notes)


def test_voodoo_zoom_has_a_lens_a_frame_and_no_more(tmp_path: Path) -> None:
    wanted = world()
    lenses = (LENS, replace(LENS, fx=84.0, fy=84.0))
    images = tuple(replace(image, camera=image.frame // 2) for image in wanted.images)
    text = foreign.voodoo(Reconstruction(lenses, images, wanted.points))
    model = voodoo.read(put(tmp_path, "a.txt", text), SIZE).reconstruction
    assert [lens.fx for lens in model.cameras] == pytest.approx([80.0, 84.0])
    assert [image.camera for image in model.images] == [0, 0, 1, 1]


def test_voodoo_distortion_is_on_the_sensor_in_millimetres(tmp_path: Path) -> None:
    """K3 of 0.1 per mm^2 at a focal length of 0.8 mm is 0.064 in focal lengths."""
    found = voodoo.read(put(tmp_path, "a.txt", foreign.voodoo(world(), k3=0.1, k5=0.02)), SIZE)
    camera = found.reconstruction.cameras[0]
    seen = np.array([[0.5, 0.3], [-0.2, 0.4]])
    square = (seen * seen).sum(axis=1, keepdims=True)
    true = seen * (1 + 0.1 * 0.64 * square + 0.02 * 0.4096 * square**2)
    np.testing.assert_allclose(camera.distort(true) * 80, seen * 80, atol=0.01)
    assert any("K3 and K5 are taken to undistort" in note for note in found.notes)


def test_voodoo_of_very_many_points_is_thinned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four frames of twelve points may be looked at sixteen times: every third point."""
    monkeypatch.setattr(voodoo, "MOST_SIGHTINGS", 16)
    found = voodoo.read(put(tmp_path, "a.txt", foreign.voodoo(world())), SIZE)
    assert len(found.reconstruction.points) == 12
    assert all(set(image.points) <= {0, 3, 6, 9} for image in found.reconstruction.images)
    assert any("one in 3 is" in note for note in found.notes)


def test_voodoo_without_points_says_how_to_export_them(tmp_path: Path) -> None:
    text = foreign.voodoo(world()).split("# 3D Feature")[0]
    with pytest.raises(UserError, match="Export All"):
        voodoo.read(put(tmp_path, "a.txt", text), SIZE)


def test_voodoo_of_a_camera_that_only_turns_is_flagged(tmp_path: Path) -> None:
    wanted = world()
    turning = tuple(replace(image, translation=np.zeros(3)) for image in wanted.images)
    text = foreign.voodoo(replace(wanted, images=turning))
    path = put(tmp_path, "a.txt", text)
    assert ONLY_TURNS in read_reconstruction(path, foreign.footage()).notes
    path = put(tmp_path, "b.txt", foreign.voodoo(wanted))
    assert ONLY_TURNS not in read_reconstruction(path, foreign.footage()).notes


def test_voodoo_counts_from_its_own_first_frame(tmp_path: Path) -> None:
    """From 0 where a video counts from 1; a sequence has the numbers of its files."""
    text = put(tmp_path, "a.txt", foreign.voodoo(world()))
    assert read_reconstruction(text, foreign.video()).reconstruction.frames.tolist() == [1, 2, 3, 4]
    assert read_reconstruction(text, foreign.footage()).reconstruction.frames.tolist() == [1, 2, 3, 4]
    counted = replace(foreign.footage(), frames=(0, 1, 2, 3))
    assert read_reconstruction(text, counted).reconstruction.frames.tolist() == [0, 1, 2, 3]
    later = put(tmp_path, "b.txt", foreign.voodoo(world(), first=2))
    imported = read_reconstruction(later, foreign.video())
    assert imported.reconstruction.frames.tolist() == [2, 3, 4]
    assert any("1 image of the model is not in the clip: timeindex 5" in note for note in imported.notes)


# Matching.


def known(names: tuple[str, ...], camera: Intrinsics = LENS) -> Imported:
    """A model whose k-th image has its camera at x = k / 5."""
    return Imported(world(camera, images=len(names)), "Test", names=names)


def order(imported: Imported) -> list[tuple[int, int]]:
    """(frame, index in the model), by which the camera's place tells."""
    return [(int(i.frame), round(i.centre[0] * 5)) for i in imported.reconstruction.images]


@pytest.mark.parametrize(
    "names",
    [
        ("shot_0004.png", "shot_0002.png", "shot_0001.png"),
        ("C:\\Users\\me\\Shot_0004.PNG", "C:\\Users\\me\\Shot_0002.PNG", "D:\\x\\SHOT_0001.png"),
        ("shot_0004.jpg", "shot_0002.JPG", "undistorted/shot_0001.tif"),
        ("frame_000004.png", "frame_000002.png", "frame_1.png"),
        ("take 7/4.jpg", "take 7/0002.jpg", "take 7/image.0001"),
    ],
)
def test_images_are_found_by_name_or_number(names: tuple[str, ...]) -> None:
    assert order(match(known(names), foreign.footage())) == [(1, 2), (2, 1), (4, 0)]


def test_a_videos_frames_are_found_by_number() -> None:
    imported = match(known(("frame_000004.png", "frame_000002.png")), foreign.video())
    assert order(imported) == [(2, 1), (4, 0)]
    assert any("matched by the number" in note for note in imported.notes)
    imported = match(known(("frame_0.png", "frame_3.png")), foreign.video())
    assert order(imported) == [(1, 0), (4, 1)]
    assert any("from 0" in note for note in imported.notes)


def test_folders_decide_between_namesakes() -> None:
    names = ("left/shot_0001.png", "right/shot_0001.png", "right/shot_0002.png")
    right = foreign.footage(folder="/clips/right")
    imported = match(known(names), right)
    assert order(imported) == [(1, 1), (2, 2)]
    assert any("left/shot_0001.png" in note and "not in the clip" in note for note in imported.notes)
    with pytest.raises(UserError, match=r"frame 1 .*left/shot_0001\.png or right/shot_0001\.png"):
        match(known(names), foreign.footage())
    with pytest.raises(UserError, match=r"left/0001\.jpg or right/0001\.jpg"):
        match(known(("left/0001.jpg", "right/0001.jpg")), foreign.footage())


def test_order_decides_where_names_tell_nothing() -> None:
    imported = match(known(("", "", "", "")), foreign.footage())
    assert order(imported) == [(1, 0), (2, 1), (3, 2), (4, 3)]
    assert any("in their order" in note for note in imported.notes)
    imported = match(known(("d", "b", "a", "c")), foreign.footage())
    assert order(imported) == [(1, 2), (2, 1), (3, 3), (4, 0)]
    with pytest.raises(UserError, match=r"has 3 cameras without names, and shot has frames 1 to 4"):
        match(known(("", "", "")), foreign.footage())
    with pytest.raises(UserError, match=r"none of the 3 images .*\(d, b, a\).*shot_0001\.png"):
        match(known(("d", "b", "a")), foreign.footage())


def test_what_is_left_out_is_named() -> None:
    names = tuple(f"shot_{number:04}.png" for number in range(2, 11))
    imported = match(known(names), foreign.footage())
    assert order(imported) == [(2, 0), (3, 1), (4, 2)]
    assert (
        "6 images of the model are not in the clip: shot_0005.png, shot_0006.png, shot_0007.png,"
        in " ".join(imported.notes)
    )
    assert "1 frame of the clip has no camera: 1" in imported.notes


def test_another_size_of_the_same_shape_is_scaled() -> None:
    imported = match(known(NAMES, replace(LENS, k1=-0.1)), foreign.footage(size=(192, 127)))
    camera = imported.reconstruction.cameras[0]
    assert (camera.width, camera.height, camera.fx, camera.k1) == (192, 127, 160.0, -0.1)
    assert misses(imported.reconstruction).max() < 1e-9
    with pytest.raises(UserError, match=r"pictures of 96x64, shot has 64x96 \(one of them lies on its side"):
        match(known(NAMES), foreign.footage(size=(64, 96)))
    # An anamorphic clip is shown with square pixels, which is what its lens says too.
    squeezed = match(known(NAMES, replace(LENS, fx=60.0)), foreign.footage(size=(128, 64)))
    assert squeezed.reconstruction.cameras[0].fx == pytest.approx(80.0)


def test_only_lenses_that_are_used_are_kept() -> None:
    model = world()
    lenses = tuple(replace(LENS, fx=80.0 + i, fy=80.0 + i) for i in range(4))
    images = tuple(replace(image, camera=image.frame) for image in model.images)
    foreign_model = Imported(Reconstruction(lenses, images, model.points), "Test", names=NAMES)
    imported = match(foreign_model, foreign.footage(NAMES[:2]))
    assert [lens.fx for lens in imported.reconstruction.cameras] == [80.0, 81.0]
    assert [image.camera for image in imported.reconstruction.images] == [0, 1]


# Which format.


def test_the_format_is_recognised(tmp_path: Path) -> None:
    clip = foreign.footage()
    files = {
        "Bundler v0.3": ("bundle.out", foreign.bundler(world())),
        "VisualSFM NVM (NVM_V3)": ("model.nvm", foreign.nvm(world())),
        "Voodoo text export": ("tracking.txt", foreign.voodoo(world())),
    }
    for label, (name, text) in files.items():
        folder = tmp_path / name.split(".")[0]
        folder.mkdir()
        for path in (put(folder, name, text), folder):
            assert read_reconstruction(path, clip).format == label
    for name, text in foreign.colmap_text(world()).items():
        put(tmp_path, name, text)
    assert read_reconstruction(tmp_path, clip).format == "COLMAP text"
    for name, content in foreign.colmap_binary(world()).items():
        (tmp_path / name).write_bytes(content)
    imported = read_reconstruction(tmp_path / "cameras.bin", clip)
    assert imported.format == "COLMAP binary"
    same(imported.reconstruction, world())


def test_what_is_no_model_is_told_what_would_be(tmp_path: Path) -> None:
    clip = foreign.footage()
    for path in (tmp_path / "gone.out", tmp_path, put(tmp_path, "notes.txt", "hello")):
        with pytest.raises(UserError, match=r"COLMAP.*Bundler.*\.nvm.*Voodoo"):
            read_reconstruction(path, clip)
    put(tmp_path, "bundle.out", foreign.bundler(world()))
    put(tmp_path, "model.nvm", foreign.nvm(world()))
    with pytest.raises(UserError, match=r"several models: bundle\.out, model\.nvm"):
        read_reconstruction(tmp_path, clip)


# Damage, with the place where it is.

BUNDLE = foreign.bundler(world())
MATCHES = foreign.nvm(world())
EXPORT = foreign.voodoo(world()).replace("\r\n", "\n")


def changed(text: str, line: int, words: str, word: int | None = None) -> str:
    """The text with a line, or one word on it, replaced; lines count from 1."""
    lines = text.split("\n")
    if word is None:
        lines[line - 1] = words
    else:
        split = lines[line - 1].split()
        split[word] = words
        lines[line - 1] = " ".join(split)
    return "\n".join(lines)


def in_bundle(line: int, words: str, expected: str, word: int | None = None) -> tuple[str, str, str]:
    """Suffix and text of a bundle.out with a change, and what is told of it; `changed` has the words."""
    return "out", changed(BUNDLE, line, words, word), expected


def in_nvm(line: int, words: str, expected: str, word: int | None = None) -> tuple[str, str, str]:
    """The same of a VisualSFM file."""
    return "nvm", changed(MATCHES, line, words, word), expected


def in_voodoo(line: int, words: str, expected: str, word: int | None = None) -> tuple[str, str, str]:
    """The same of a Voodoo export."""
    return "txt", changed(EXPORT, line, words, word), expected


DAMAGE = {
    "version": in_bundle(1, "# Bundle file v0.7", r"line 1: expected '# Bundle file v0\.3'"),
    "counts": in_bundle(2, "4", "line 2: expected two numbers"),
    "hostile points": in_bundle(2, "4 4294967296", "line 2: expected the number of points; 4294"),
    "long word": in_bundle(4, "1" * 1_000_000, "line 4: expected a number of at most", 0),
    "nan": in_bundle(5, "nan", "line 5: expected a number of at most 1e\\+15, not 'nan'", 1),
    "comma": in_bundle(23, "1,25", r"line 23: .*with a point, not a comma\), not '1,25'", 2),
    "focal length": in_bundle(3, "-80", "line 3: expected the focal length of camera 0", 0),
    "rotation": in_bundle(10, "7", "line 9: expected .* a rotation of camera 1", 2),
    "camera index": in_bundle(25, "-1103756645", "line 25: expected a camera from 0 to 3, not -1", 1),
    "huge views": in_bundle(25, "1e12", "ends at line 58: expected 1e\\+12 views of point 0", 0),
    "truncated": ("out", "\n".join(BUNDLE.split("\n")[:40]), "ends at line 40: expected 6 more points of 12"),
    "binary": ("out", BUNDLE[:100] + "\0" + BUNDLE[100:], "byte 100: expected text"),
    "all gone": ("out", foreign.bundler(world(), missing=(0, 1, 2, 3)), "no registered camera"),
    "nvm version": in_nvm(1, "NVM_V2", "line 1: expected NVM_V3, not 'NVM_V2'"),
    "nvm FixedK": in_nvm(1, "NVM_V3 FixedK 80 48", "line 1: expected nothing after the version"),
    "nvm cameras": in_nvm(3, "40000", "line 3: expected the number of cameras; 40000 do not fit"),
    "nvm camera": in_nvm(5, "a.png 80 1 0 0 0", "line 5: expected a file name and 10 numbers"),
    "nvm quaternion": in_nvm(5, "a.png 80 0 0 0 0 1 2 3 0 0", "line 5: expected a quaternion"),
    "nvm radial": (
        "nvm",
        changed(foreign.nvm(world(), origin=(48.0, 32.0)), 6, "-1e9", 9),
        "line 6: expected the radial distortion of a lens, under which",
    ),
    "nvm points": in_nvm(9, "13", "line 22: expected X Y Z R G B, a count and features"),
    "nvm views": in_nvm(12, "9", "line 12: expected 9 features of 4 numbers each, not 12", 6),
    "nvm truncated": (
        "nvm",
        "\n".join(MATCHES.split("\n")[:15]),
        "ends at line 15: expected 6 more lines of 12",
    ),
    "voodoo header": in_voodoo(2, "# Text", "not a model in a known format"),
    "voodoo axes": in_voodoo(8, "3", "line 8: expected A, H and V", 3),
    "voodoo size": in_voodoo(10, "96.5", "line 10: expected a picture of 1 to 1000000 pixels", 16),
    "voodoo K3": in_voodoo(10, "-1e6", "line 10: expected K3 and K5 of a lens", 12),
    "voodoo point": in_voodoo(17, "1 2", "line 17: expected X Y Z of a point, not 2 numbers"),
    "voodoo truncated": ("txt", "\n".join(EXPORT.split("\n")[:6]), "ends at line 6: expected 3D points"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_damage_is_told_with_its_place(tmp_path: Path, case: str) -> None:
    suffix, text, message = DAMAGE[case]
    path = put(tmp_path, f"model.{suffix}", text)
    with pytest.raises(UserError, match=message) as caught:
        read_reconstruction(path, foreign.footage())
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    assert len(str(caught.value)) < 600


def test_a_clip_is_no_model(tmp_path: Path) -> None:
    clip: Footage = foreign.footage()
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"\0\0\0 ftypisom")
    with pytest.raises(UserError, match="not a model in a known format"):
        read_reconstruction(path, clip)
