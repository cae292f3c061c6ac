"""Colours of picture files are read as their tags say: as Blender and LittleCMS read the same files."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from addon.core.base.errors import UserError
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import encode_srgb, to_linear
from addon.scene.sources.colour_space import image_space, space_of

from ..media.colour_curves import REC_709, REC_2020, WHITE, hlg, pq, to_xyz
from ..pictures import exr, sequence, with_chunks, with_profile
from ..variants import combined

STORED = np.random.default_rng(0).integers(0, 65536, (16, 16, 3)).astype(np.uint16)
PNG = cv2.imencode(".png", STORED[..., ::-1])[1].tobytes()
P3 = ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06))
ADOBE = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06))
PROFILES = Path(bpy.utils.system_resource("DATAFILES")) / "colormanagement" / "icc"


def opened(folder: Path, data: bytes, suffix: str = ".png") -> Footage:
    return open_footage(sequence(folder, data, suffix))


def light(clip: Footage, scene: bpy.types.Scene) -> np.ndarray:
    """(h, w, 3) linear Rec.709 of the second frame."""
    space, stored = space_of(scene.virtual_aperture, clip), clip.read(2)
    return to_linear(stored if space is None else space.to_light(stored))[..., :3].astype(float)


def in_blender(file: Path) -> tuple[np.ndarray, str]:
    """(h, w, 3) of a file of 16 bits by Blender, and the name of the colour space that it takes."""
    image = bpy.data.images.load(str(file))
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, :3], image.colorspace_settings.name


def cicp(primaries: int, transfer: int, full: bool = True) -> bytes:
    return with_chunks(PNG, cICP=bytes([primaries, transfer, 0, full]))


@pytest.mark.parametrize("codes", [(1, 4), (1, 13), (9, 8), (9, 16), (9, 18), (12, 1)])
def test_codes_mean_what_they_do_in_blender(
    scene: bpy.types.Scene, tmp_path: Path, codes: tuple[int, int]
) -> None:
    clip = opened(tmp_path, cicp(*codes))
    expected, name = in_blender(clip.files[1])
    assert image_space(scene.virtual_aperture, clip) == name and not clip.notes
    found = light(clip, scene)
    assert np.abs(found - expected).max() < 2e-5 * np.abs(expected).max()


def decoded(codes: tuple[int, int]) -> np.ndarray:
    """(h, w, 3) linear Rec.709 of `STORED` by the recommendations' formulas, inverted by search."""
    primaries = {1: REC_709, 9: REC_2020, 12: P3}[codes[0]]
    values = STORED / 65535
    grid = np.linspace(0, 1, 200_001) ** 4
    if codes[1] == 16:
        own = np.interp(values, pq(50 * grid), 50 * grid)
    else:
        own = values ** {1: 2.4, 4: 2.2, 5: 2.8, 14: 2.4, 15: 2.4}.get(codes[1], 1.0)
        if codes[1] == 13:
            own = np.interp(values, encode_srgb(grid), grid)
    return np.asarray(own @ (np.linalg.inv(to_xyz(REC_709)) @ to_xyz(primaries)).T)


@pytest.mark.parametrize("codes", [(1, 5), (9, 4), (9, 13), (12, 16)])
def test_codes_that_blender_takes_for_srgb(
    scene: bpy.types.Scene, tmp_path: Path, codes: tuple[int, int]
) -> None:
    expected, found = decoded(codes), light(opened(tmp_path, cicp(*codes)), scene)
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize(("codes", "deep"), [((9, 16), False), ((12, 13), True)])
def test_narrow_range(scene: bpy.types.Scene, tmp_path: Path, codes: tuple[int, int], deep: bool) -> None:
    """The same signal in the narrow and in the full range (ITU-T H.273, 8.3)."""
    signal = np.linspace(0, 1, 192).reshape(8, 8, 3)
    top, step = (65535, 256) if deep else (255, 1)
    found = []
    for full in (True, False):
        stored = np.round(signal * top if full else (219 * signal + 16) * step).astype(np.uint16)
        png = cv2.imencode(".png", stored if deep else stored.astype(np.uint8))[1].tobytes()
        made = with_chunks(png, cICP=bytes([*codes, 0, full]))
        clip = opened(tmp_path / str(full), made)
        found.append(clip.read(2) / (65535 if clip.read(2).dtype == np.uint16 else 255))
        light(clip, scene)
    assert np.abs(found[0] - found[1]).max() < 1.1 / (top if deep else 219)


@pytest.mark.parametrize("codes", [(3, 13), (9, 12)])
def test_codes_that_are_not_known_are_named(
    scene: bpy.types.Scene, tmp_path: Path, codes: tuple[int, int]
) -> None:
    clip = opened(tmp_path, cicp(*codes))
    assert clip.notes == [
        f"f_0001.png: color primaries {codes[0]} with transfer function {codes[1]} are not known: its colors"
        " are taken for sRGB"
    ]


def gama(value: int) -> bytes:
    return struct.pack(">I", value)


def chrm(primaries: tuple[tuple[float, float], ...]) -> bytes:
    return struct.pack(">8I", *(round(1e5 * each) for xy in (WHITE, *primaries) for each in xy))


def to_709(primaries: tuple[tuple[float, float], ...]) -> np.ndarray:
    return np.asarray(np.linalg.inv(to_xyz(REC_709)) @ to_xyz(primaries))


@pytest.mark.parametrize(
    ("value", "primaries"),
    combined([100_000, 55_556, 50_000, 38_462, 45_455, 0], [P3, None, REC_709, ADOBE, REC_2020]),
)
def test_gamma_and_chromaticities(
    scene: bpy.types.Scene, tmp_path: Path, value: int, primaries: tuple[tuple[float, float], ...] | None
) -> None:
    chunks = {} if primaries is None else {"cHRM": chrm(primaries)}
    if value:
        chunks["gAMA"] = gama(value)
    clip = opened(tmp_path, with_chunks(PNG, **chunks))
    plain = value in (0, 45_455)
    own = decoded((1, 13)) if plain else (STORED / 65535) ** (100_000 / value)
    expected = own if primaries is None else own @ to_709(primaries).T
    # Blender's nearest space may be taken.
    assert np.abs(light(clip, scene) - expected).max() < 4e-3


def test_the_best_tag_counts(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """PNG, third edition, 4.3: cICP, then iCCP, then sRGB, then gAMA and cHRM."""
    profile = b"x\0\0" + zlib.compress((PROFILES / "srgb_p3d65_display.icc").read_bytes())
    chunks = {"cICP": bytes([9, 16, 0, 1]), "iCCP": profile, "sRGB": b"\0", "gAMA": gama(100_000)}
    expected = ["Rec.2100-PQ", "Display P3", "sRGB", "Linear Rec.709"]
    for number, name in enumerate(expected):
        left = dict(list(chunks.items())[number:])
        clip = opened(tmp_path / str(number), with_chunks(PNG, **left))
        assert image_space(scene.virtual_aperture, clip) == name, number
    # One that names nothing leaves it to the next.
    left = chunks | {"cICP": bytes([2, 2, 0, 1])}
    assert image_space(scene.virtual_aperture, opened(tmp_path / "none", with_chunks(PNG, **left))) == (
        "Display P3"
    )


def profile(kind: str) -> bytes:
    """A profile of Blender's, LittleCMS's, or one that is built here as ICC.1:2022 describes them."""
    if kind == "LittleCMS sRGB":
        return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    if kind.endswith("display"):
        return (PROFILES / f"{kind}.icc").read_bytes()
    name, _, transfer = kind.partition(" ")
    fixed = lambda *values: struct.pack(f">{len(values)}i", *(round(65536 * each) for each in values))  # noqa: E731
    kinds = {
        "1.8": b"curv" + bytes(4) + struct.pack(">IH", 1, round(1.8 * 256)),
        "2.2": b"curv" + bytes(4) + struct.pack(">IH", 1, 563),
        "linear": b"curv" + bytes(8),
        "table": b"curv" + bytes(4) + struct.pack(">I1024H", 1024, *np.round(
            65535 * np.linspace(0, 1, 1024) ** 2.1).astype(int)),
        "0": b"para" + bytes(4) + struct.pack(">HH", 0, 0) + fixed(2.5),
        "1": b"para" + bytes(4) + struct.pack(">HH", 1, 0) + fixed(2.0, 1.1, -0.1),
        "3": b"para" + bytes(4) + struct.pack(">HH", 3, 0) + fixed(2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92,
                                                                 0.04045),
        "4": b"para" + bytes(4) + struct.pack(">HH", 4, 0) + fixed(2.4, 0.9, 0.1, 0.1, 0.05, 0.0, 0.0),
    }  # fmt: skip
    curve = kinds[transfer]
    if name == "Gray":
        parts = {b"kTRC": curve, b"wtpt": b"XYZ " + bytes(4) + fixed(0.9642, 1.0, 0.8249)}
    else:
        bradford = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
        white, d50 = to_xyz(REC_709).sum(axis=1), np.array([0.9642, 1.0, 0.8249])
        adapt = np.linalg.inv(bradford) @ np.diag(bradford @ d50 / (bradford @ white)) @ bradford
        columns = adapt @ to_xyz({"P3": P3, "Adobe": ADOBE, "Rec2020": REC_2020, "sRGB": REC_709}[name])
        parts = {b"wtpt": b"XYZ " + bytes(4) + fixed(0.9642, 1.0, 0.8249)}
        for at, letter in enumerate(b"rgb"):
            parts[bytes([letter]) + b"XYZ"] = b"XYZ " + bytes(4) + fixed(*columns[:, at])
            parts[bytes([letter]) + b"TRC"] = curve
    start, table, body = 132 + 12 * len(parts), b"", b""
    for key, value in parts.items():
        table += key + struct.pack(">II", start + len(body), len(value))
        body += value + bytes(-len(value) % 4)
    space = b"GRAY" if name == "Gray" else b"RGB "
    head = (
        struct.pack(">I", start + len(body)) + b"lcms\x04\x30\0\0mntr" + space + b"XYZ " + bytes(12) + b"acsp"
    )
    head += bytes(28) + fixed(0.9642, 1.0, 0.8249)
    return head.ljust(128, b"\0") + struct.pack(">I", len(parts)) + table + body


RGB_PROFILES = [
    "LittleCMS sRGB", "srgb_p3d65_display", "g24_rec709_display", "g24_rec2020_display", "P3 3", "P3 2.2",
    "Adobe 2.2", "Adobe linear", "sRGB 1.8", "sRGB table", "Rec2020 0", "sRGB 1", "P3 4", "Adobe 3",
]  # fmt: skip


@pytest.mark.parametrize(("suffix", "kind"), combined([".png", ".jpg", ".tif"], RGB_PROFILES))
def test_profiles_mean_what_they_do_in_littlecms(
    scene: bpy.types.Scene, tmp_path: Path, kind: str, suffix: str
) -> None:
    data, eight = profile(kind), np.kron(STORED >> 8, np.ones((8, 8, 1))).astype(np.uint8)
    file = io.BytesIO()
    options = {"quality": 100, "subsampling": 0} if suffix == ".jpg" else {}
    Image.fromarray(eight).save(file, {".png": "PNG", ".jpg": "JPEG", ".tif": "TIFF"}[suffix], **options)
    made = file.getvalue()
    if suffix == ".png":
        made = with_chunks(made, iCCP=b"x\0\0" + zlib.compress(data))
    elif suffix == ".jpg":
        # Large profiles come in several segments.
        made = with_profile(made, data, step=200)
    else:
        file = io.BytesIO()
        Image.fromarray(eight).save(file, "TIFF", icc_profile=data)
        made = file.getvalue()
    clip = opened(tmp_path, made, suffix)
    assert not clip.notes
    own = ImageCms.ImageCmsProfile(io.BytesIO(data))
    read = Image.open(io.BytesIO(made)).convert("RGB")
    to = ImageCms.createProfile("sRGB")
    expected = np.asarray(ImageCms.profileToProfile(read, own, to, renderingIntent=1, outputMode="RGB"))
    found = light(clip, scene)
    inside = ((found > 0.003) & (found < 0.995)).all(axis=2)
    assert inside.any()
    # LittleCMS rounds to whole numbers, and JPEG decoders differ by one of them.
    off = np.abs(255 * encode_srgb(np.clip(found, 0, 1)) - expected)[inside]
    assert off.max() < (3 if suffix == ".jpg" else 1.5)


@pytest.mark.parametrize("kind", ["Gray 3", "Gray table"])
def test_profiles_of_gray(scene: bpy.types.Scene, tmp_path: Path, kind: str) -> None:
    data, ramp = profile(kind), np.tile(np.arange(256, dtype=np.uint8), (16, 1))
    png = with_chunks(cv2.imencode(".png", ramp)[1].tobytes(), iCCP=b"x\0\0" + zlib.compress(data))
    own = ImageCms.ImageCmsProfile(io.BytesIO(data))
    to = ImageCms.createProfile("sRGB")
    expected = np.asarray(
        ImageCms.profileToProfile(Image.fromarray(ramp), own, to, renderingIntent=1, outputMode="RGB")
    )
    found = 255 * encode_srgb(np.clip(light(opened(tmp_path, png), scene), 0, 1))
    assert np.abs(found - expected)[:, 8:].max() < 1.5


def test_profiles_that_cannot_be_honoured_are_named(scene: bpy.types.Scene, tmp_path: Path) -> None:
    tables = profile("sRGB 2.2").replace(b"rXYZ", b"A2B0")
    cmyk = profile("sRGB 2.2").replace(b"RGB XYZ ", b"CMYKXYZ ")
    cases = {
        "its color profile has tables alone": tables, "its color profile is for CMYK": cmyk,
        "its color profile is damaged": profile("sRGB 2.2")[:200],
    }  # fmt: skip
    for number, (problem, data) in enumerate(cases.items()):
        png = with_chunks(PNG, iCCP=b"x\0\0" + zlib.compress(data))
        clip = opened(tmp_path / str(number), png)
        assert clip.notes == [f"f_0001.png: {problem}: its colors are taken for sRGB"]
        assert space_of(scene.virtual_aperture, clip) is None


EXR_PRIMARIES = {
    "Linear Rec.2020": (*REC_2020, WHITE),
    "ACEScg": ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044), (0.32168, 0.33767)),
}  # fmt: skip


@pytest.mark.parametrize("name", ["ACEScg", "Linear Rec.2020", "Linear Rec.709"])
def test_chromaticities_of_light(scene: bpy.types.Scene, tmp_path: Path, name: str) -> None:
    """As Blender shows an image of the same light whose colour space is set by name."""
    stored = np.random.default_rng(2).random((16, 16, 3)).astype(np.float16)
    corners = EXR_PRIMARIES.get(name, (*REC_709, WHITE))
    made = exr(stored, chromaticities=("chromaticities", np.array(corners, "<f4").tobytes()))
    clip = opened(tmp_path / "tagged", made, ".exr")
    plain = opened(tmp_path / "plain", exr(stored), ".exr")
    np.testing.assert_array_equal(clip.read(1)[..., :3], stored)
    scene.virtual_aperture.colour_space = name
    expected = light(plain, scene)
    scene.virtual_aperture.colour_space = ""
    assert image_space(scene.virtual_aperture, clip) == name
    np.testing.assert_allclose(light(clip, scene), expected, atol=2e-3)


@pytest.mark.parametrize(
    ("identifier", "name"),
    [("lin_ap1_scene", "ACEScg"), ("srgb_p3d65_display", "Display P3")],
)
def test_files_that_blender_itself_tags(
    scene: bpy.types.Scene, tmp_path: Path, identifier: str, name: str
) -> None:
    stored = (2 * np.random.default_rng(2).random((16, 16, 3))).astype(np.float16)
    made = exr(stored, colorInteropID=("string", identifier.encode()))
    clip = opened(tmp_path, made, ".exr")
    expected, taken = in_blender(clip.files[1])
    assert image_space(scene.virtual_aperture, clip) == taken == name
    np.testing.assert_allclose(light(clip, scene), expected, atol=1e-3)


def test_odd_primaries_are_read_and_not_shown_in_blender(scene: bpy.types.Scene, tmp_path: Path) -> None:
    corners = ((0.6, 0.33), (0.3, 0.55), (0.15, 0.1))
    stored = np.random.default_rng(2).random((16, 16, 3)).astype(np.float16)
    value = np.array([*corners, WHITE], "<f4").tobytes()
    clip = opened(tmp_path, exr(stored, chromaticities=("chromaticities", value)), ".exr")
    expected = stored.astype(float) @ to_709(corners).T
    np.testing.assert_allclose(light(clip, scene), expected, atol=2e-3)
    assert image_space(scene.virtual_aperture, clip) == ""


def test_frames_of_other_colours_are_refused_by_name(scene: bpy.types.Scene, tmp_path: Path) -> None:
    folder = sequence(tmp_path, cicp(9, 16), ".png")
    (folder / "f_0002.png").write_bytes(PNG)
    clip = open_footage(folder)
    clip.read(1)
    with pytest.raises(UserError, match=r"the colors of f_0002\.png are stored in another way"):
        clip.read(2)


def test_frames_that_are_tagged_alike_in_other_words_are_one_clip(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    """Editors add a profile, or leave it out."""
    packed = b"x\0\0" + zlib.compress(profile("LittleCMS sRGB"))
    ways = [
        with_chunks(PNG, iCCP=packed),
        PNG,
        with_chunks(PNG, sRGB=b"\0"),
        with_chunks(PNG, gAMA=gama(45_455)),
    ]
    for number, data in enumerate(ways, 1):
        (tmp_path / f"f_{number}.png").write_bytes(data)
    clip = open_footage(tmp_path)
    assert all(np.array_equal(clip.read(1), clip.read(frame)) for frame in clip.frames)
    assert space_of(scene.virtual_aperture, clip) is None


def test_hdr_light(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """PQ and HLG by the formulas of ITU-R BT.2100, which share nothing with Blender's configuration."""
    truth = np.random.default_rng(4).uniform(0.001, 4, (16, 16, 3))
    wide = truth @ np.linalg.inv(to_709(REC_2020)).T
    for transfer, curve in ((16, pq), (18, hlg)):
        stored = np.round(65535 * np.clip(curve(wide), 0, 1)).astype(np.uint16)
        png = with_chunks(
            cv2.imencode(".png", stored[..., ::-1])[1].tobytes(), cICP=bytes([9, transfer, 0, 1])
        )
        found = light(opened(tmp_path / str(transfer), png), scene)
        np.testing.assert_allclose(found, truth, rtol=3e-3, atol=3e-3)
