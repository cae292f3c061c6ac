"""Clips of 10 bits, HLG, PQ and cameras' logs come to linear light through Blender's configuration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.media.clip import open_footage
from addon.core.media.colour_space import of_tags
from addon.core.media.light import to_linear
from addon.scene.sources import colour_space
from tests.media.colour_curves import HLG, LOGS, PQ, Array, Recorded, write_clip


def scene_light() -> Array:
    """(48, 64, 3) linear Rec.709: patches of many colours from a thousandth to a little over white, each of
    four pixels, so that no codec mixes them much."""
    draw = np.random.default_rng(3)
    level = 10 ** draw.uniform(-2.5, 0.1, (6, 8, 1))
    colour = draw.uniform(0.15, 1.0, (6, 8, 3))
    return np.asarray(np.kron(level * colour, np.ones((8, 8, 1))))


@pytest.mark.parametrize("space", [HLG, PQ, *LOGS], ids=lambda space: space.name)
@pytest.mark.parametrize("codec", ["prores_ks", "libx265"])
def test_light_is_what_was_filmed(registered: None, tmp_path: Path, space: Recorded, codec: str) -> None:
    """To 1/255 of the signal, by the makers' papers, which share nothing with Blender's configuration."""
    light, path = scene_light(), tmp_path / "clip.mov"
    write_clip(path, [light] * 3, space, codec)
    clip = open_footage(path)
    stored = clip.read(2)
    assert stored.dtype == np.uint16
    assert clip.colour_space == (space.name if space.transfer != 2 else of_tags(2, 9) * (space is LOGS[2]))
    found = to_linear(colour_space.colour_space(space.name).to_light(stored))[..., :3].astype(float)
    inner = np.s_[3::8], np.s_[3::8]
    error = np.abs(space.stored(found) - space.stored(light))[inner]
    print(f"{space.name}, {codec}: {255 * error.max():.2f} of 255")
    assert error.max() < 1 / 255


@pytest.mark.parametrize("full", [False, True])
def test_ten_bits_are_read_as_they_are(tmp_path: Path, full: bool) -> None:
    plain = Recorded("sRGB", lambda light: light, HLG.primaries, 14)
    one = np.linspace(0, 1, 64)
    ramp = np.repeat(np.stack([one, np.roll(one, 20), one[::-1]], axis=1)[None], 48, axis=0)
    write_clip(tmp_path / "clip.mov", [ramp], plain, "libx265", full)
    stored = open_footage(tmp_path / "clip.mov").read(1)
    # Half a code of luma, and half a one of what is blue, which counts 1.88 times.
    steps = (0.5 / 1023, 0.5 / 1023) if full else (0.5 / 876, 0.5 / 896)
    assert np.abs(stored / 65535 - plain.stored(ramp)).max() < steps[0] + 1.881 * steps[1] + 2e-5


def test_views_are_no_color_spaces_of_clips(registered: None) -> None:
    with pytest.raises(UserError, match="AgX Base sRGB is for views"):
        colour_space.colour_space("AgX Base sRGB")
    with pytest.raises(UserError, match="there is no color space 'S-Log9'; Blender has ACES"):
        colour_space.checked("S-Log9")
    assert colour_space.checked("s-log3 s-gamut3.cine") == "S-Log3 S-Gamut3.Cine"
