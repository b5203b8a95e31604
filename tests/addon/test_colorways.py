"""What is chosen in the list of colorways is shown, and what is changed is kept in it."""

import bpy
import pytest

from dyehouse.addon import colorways, recipes


@pytest.fixture(autouse=True)
def settings(blender: None) -> bpy.types.PropertyGroup:
    """Settings of a photo with two regions and two colorways."""
    made = bpy.data.images.new("photo", 8, 8).dyehouse
    for name in ("Upper", "Sole"):
        made.regions.add().name = name
    made.regions[0].target.color, made.regions[1].target.text = (0.1, 0.2, 0.3), "#102030"
    for name, text in (("First", ""), ("Second", "lab(42, 55, 35)")):
        made.colorways.add().name = name
        made["active_colorway"] = len(made.colorways) - 1
        if text:
            made.regions[0].target.text = text
        colorways.keep(made)
    return made


def shown(settings: bpy.types.PropertyGroup) -> list[object]:
    return [r.target.text or tuple(round(c, 6) for c in r.target.color) for r in settings.regions]


def test_the_chosen_colorway_is_shown(settings: bpy.types.PropertyGroup) -> None:
    settings.active_colorway = 0
    assert shown(settings) == [(0.1, 0.2, 0.3), "#102030"]
    settings.active_colorway = 1
    assert shown(settings) == ["lab(42, 55, 35)", "#102030"]


def test_a_change_is_kept_in_the_chosen_colorway_only(settings: bpy.types.PropertyGroup) -> None:
    settings.active_colorway = 0
    settings.regions[1].target.text = "#AABBCC"
    settings.regions[0].target.used = False
    settings.active_colorway = 1
    assert shown(settings) == ["lab(42, 55, 35)", "#102030"]
    assert settings.regions[0].target.used
    settings.active_colorway = 0
    assert shown(settings)[1] == "#AABBCC"
    assert not settings.regions[0].target.used
    asked = recipes.colorway_of(settings.colorways[0], settings.id_data)
    assert asked.name == "First"
    assert asked.targets[0] is None


def test_a_color_changed_in_the_list_is_shown(settings: bpy.types.PropertyGroup) -> None:
    settings.active_colorway = 1
    settings.colorways[1].targets[0].color = (0.9, 0.1, 0.1)
    assert shown(settings)[0] == pytest.approx((0.9, 0.1, 0.1))
    settings.colorways[0].targets[0].color = (0.5, 0.5, 0.5)
    assert shown(settings)[0] == pytest.approx((0.9, 0.1, 0.1))


def test_a_region_that_a_colorway_does_not_know_keeps_its_color(settings: bpy.types.PropertyGroup) -> None:
    settings.regions.add().name = "Laces"
    settings.active_colorway = 0
    assert not settings.regions[2].target.used
    assert recipes.colorway_of(settings.colorways[0], settings.id_data).targets[2] is None
