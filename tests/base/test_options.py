"""An option that is declared once is a Blender property, an option of the command line, and checked."""

from __future__ import annotations

import argparse
import doctest
from collections.abc import Iterator
from dataclasses import dataclass, replace

import bpy
import numpy as np
import pytest

from addon.cli.options import Parser, UsageError, add_options, text_of
from addon.core.base import options as declared
from addon.core.base.options import Option, option, options_of
from addon.core.frame.options import APERTURE_OPTIONS, FRAME_OPTIONS, frame_values
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import FINAL
from addon.core.optics.aperture import Aperture
from addon.scene.base.option_properties import values_of, with_options


@dataclass(frozen=True)
class Choice:
    """What can be chosen."""

    number: int
    help: str


KINDS = {"box": Choice(0, "Fast"), "gauss": Choice(4, "Smooth")}


@dataclass(frozen=True)
class Sharpening:
    """Options of a stage that does not exist."""

    amount: float = option(0.5, "Sharpening", "How much edges are raised", least=0.0, most=2.0)
    turn: float = option(0.0, "Turn", "Of the kernel", unit="ANGLE")
    steps: int = option(0, "Steps", "How often", least=0, most=9, words={"auto": 0})
    halo: bool = option(True, "Halo", "Whether edges may overshoot")
    kernel: str = option("gauss", "Kernel", "What is taken away", choices=KINDS)


OPTIONS: dict[str, Option] = {
    f"sharpening_{name}": replace(each, name=f"sharpening_{name}")
    for name, each in options_of(Sharpening).items()
}


@pytest.fixture
def group(registered: None) -> Iterator[bpy.types.PropertyGroup]:
    """A property group that holds those options."""
    changed: list[str] = []

    @with_options(OPTIONS, lambda _group, _context: changed.append("edited"), ["sharpening_steps"])
    class SharpeningGroup(bpy.types.PropertyGroup):
        edits = changed

    bpy.utils.register_class(SharpeningGroup)
    bpy.types.Scene.test_sharpening = bpy.props.PointerProperty(type=SharpeningGroup)
    try:
        yield bpy.context.scene.test_sharpening
    finally:
        del bpy.types.Scene.test_sharpening
        bpy.utils.unregister_class(SharpeningGroup)


def parsed(*words: str) -> argparse.Namespace:
    parser = Parser()
    add_options(parser, OPTIONS)
    return parser.parse_args(words)


def test_the_example_of_the_module() -> None:
    found = doctest.testmod(declared, optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
    assert found.attempted and not found.failed


def test_a_new_option_is_a_property(group: bpy.types.PropertyGroup) -> None:
    own = group.bl_rna.properties
    amount, kernel = own["sharpening_amount"], own["sharpening_kernel"]
    assert (amount.name, amount.description, amount.default) == (
        "Sharpening",
        "How much edges are raised",
        0.5,
    )
    assert (amount.hard_min, amount.hard_max) == (0.0, 2.0)
    assert own["sharpening_turn"].subtype == "ANGLE"
    assert [(item.identifier, item.value) for item in kernel.enum_items] == [("box", 0), ("gauss", 4)]
    group.sharpening_steps = 4
    group.sharpening_amount = 1.5
    assert group.edits == ["edited"]
    values = values_of(group, OPTIONS)
    assert values == {
        "sharpening_amount": 1.5, "sharpening_turn": 0.0, "sharpening_steps": 4, "sharpening_halo": True,
        "sharpening_kernel": "gauss",
    }  # fmt: skip


def test_a_new_option_is_one_of_the_command_line() -> None:
    assert vars(parsed()) == dict.fromkeys(OPTIONS)
    found = parsed("--sharpening-amount", "1.5", "--sharpening-turn", "90", "--sharpening-steps", "auto",
                 "--sharpening-halo", "off", "--sharpening-kernel", "box")  # fmt: skip
    assert vars(found) == {
        "sharpening_amount": 1.5, "sharpening_turn": np.pi / 2, "sharpening_steps": 0,
        "sharpening_halo": False, "sharpening_kernel": "box",
    }  # fmt: skip
    # As other processes are told.
    words = [
        f"--{name.replace('_', '-')}={text_of(OPTIONS[name], value)}" for name, value in vars(found).items()
    ]
    assert vars(parsed(*words)) == vars(found)


@pytest.mark.parametrize(
    ("words", "why"),
    [("amount=3", "sharpening cannot be 3; give a number from 0 to 2"), ("steps=1.5", "not a whole number"),
     ("halo=2", "it can also be on or off"), ("kernel=disc", "choose"), ("turn=nan", "is not a number")],
)  # fmt: skip
def test_a_value_that_is_beyond_is_refused(words: str, why: str) -> None:
    with pytest.raises(UsageError, match=why):
        parsed(f"--sharpening-{words}")


def test_every_option_of_a_frame_is_a_property_and_one_of_the_command_line(scene: bpy.types.Scene) -> None:
    settings = scene.virtual_aperture
    values = values_of(settings, FRAME_OPTIONS)
    made = frame_values({**values, "quality": "final", "highlights": 0.0})
    assert made["quality"] is FINAL and made["highlights"].gain == 0
    assert set(made) <= set(FrameOptions.__dataclass_fields__)
    assert Aperture(**values_of(settings.shape, APERTURE_OPTIONS)) == Aperture()
    parser = Parser()
    add_options(parser, FRAME_OPTIONS)
    assert set(vars(parser.parse_args([]))) == set(FRAME_OPTIONS)


@pytest.mark.parametrize("method", ["grid", "edges"])
def test_a_method_of_the_first_release_is_still_read(method: str) -> None:
    parser = Parser()
    add_options(parser, {"method": FRAME_OPTIONS["method"]})
    assert parser.parse_args(["--method", method]).method == "features"
    assert text_of(FRAME_OPTIONS["method"], "features") == "features"
