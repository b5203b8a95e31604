"""What the user sets for a photo, saved with the image in the .blend.

Everything here is a parameter; what is computed from it lives in `session`. Pixel positions are (x, y) from the top
left. Colors are in the .blend's working space, as Blender's color buttons show them.
"""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

NOWHERE = (-1, -1)

# Of paths in which `//` stands for the folder of the .blend.
RELATIVE = {"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"}

WHITES = (
    ("BALANCED", "Balanced", "The photo is white-balanced: equal red, green and blue are white"),
    ("PIXEL", "Card in the Photo", "A white or gray card, picked in the photo"),
    ("ILLUMINANT", "Illuminant", "A standard light by name, such as D65, A or FL11"),
    ("TEMPERATURE", "Temperature", "A black body or daylight of this color temperature"),
    ("HIGHLIGHTS", "From Highlights", "Estimated from the highlights of the product"),
    ("COLOR", "Color", "Linear color of a perfect white diffuser in the photo's light"),
)

LIGHTS = (
    ("SAME", "Unchanged", "Keep the light of the photo"),
    ("ILLUMINANT", "Illuminant", "A standard light by name, such as D65, A or FL11"),
    ("TEMPERATURE", "Temperature", "A black body or daylight of this color temperature"),
    ("COLOR", "Color", "Linear color of a perfect white diffuser in the new light"),
)

REFERENCES = (
    ("FOUND", "Found in the Region", "The matte color of the region, found by itself"),
    ("PIXEL", "Picked Pixel", "A matte, lit pixel of the product"),
    ("COLOR", "Color", "Linear color of the product, as a number"),
)

MASKS = (
    ("CLICK", "Clicked Product", "What the clicked pixel shows: one material, with its folds and highlights"),
    ("WHOLE", "Whole Picture", "Every pixel"),
    ("ALPHA", "Alpha", "What the photo's alpha covers"),
    ("IMAGE", "Image", "A mask image, white where the product is; paint it or load it"),
    ("SPLINE", "Spline Mask", "A mask of Blender's mask editor"),
    ("CRYPTOMATTE", "Cryptomatte", "Objects or materials of a render, from its cryptomatte passes"),
    ("FILE", "File", "A mask file, white where the product is"),
)

MEANINGS = (
    ("reference", "Color at Reference", "A matte reference pixel shall have exactly the target color"),
    ("product", "Product Reflectance", "The product shall have the target's reflectance, in the light of the photo"),
)

RESIDUALS = (
    ("fade", "Fade", "Keep what the model does not explain if the new color is near the old one"),
    ("keep", "Keep", "Keep all that the model does not explain"),
    ("drop", "Drop", "Drop all that the model does not explain"),
)

VIEWS = (
    ("FULL", "Full", "The recolored photo over the whole picture"),
    ("SPLIT", "Split", "The photo to the left of a line, the recolored photo to the right of it"),
    ("SIDE", "Beside", "The photo, and the recolored photo beside it"),
)

OVERLAYS = (
    ("NONE", "None", "Only the picture"),
    ("REGION", "Region", "The active region"),
    ("A", "Body (A)", "Body reflection relative to the reference"),
    ("B", "Surface (B)", "Surface reflection relative to the white"),
    ("RESIDUAL", "Residual", "What the model does not explain"),
    ("ERROR", "Predicted Error", "Color difference to expect, CIEDE2000"),
    ("GAMUT", "Out of Gamut", "Pixels that the output cannot hold"),
)

EXISTING = (
    ("KEEP", "Leave Alone", "Do nothing where there are results already"),
    ("RESUME", "Resume", "Make only what is missing, or has changed since"),
    ("FORCE", "Make Anew", "Replace them all"),
)

OBSERVERS = (
    ("1931", "2° (1931)", "CIE 1931 standard observer"),
    ("1964", "10° (1964)", "CIE 1964 standard observer"),
)

ADAPTATIONS = (
    ("cat16", "CAT16", "Chromatic adaptation of CIECAM16"),
    ("bradford", "Bradford", "Chromatic adaptation of ICC profiles"),
)

# Kept alive: Blender does not hold on to the strings of a computed list.
_lists: dict[str, list[tuple[str, str, str]]] = {}


def _models(_self: object, _context: object) -> list[tuple[str, str, str]]:
    if "models" not in _lists:
        from ..core.analysis import MODELS

        _lists["models"] = [(name, name.replace("_", " ").title(), _MODEL_TIPS.get(name, "")) for name in MODELS]
    return _lists["models"]


_MODEL_TIPS = {
    "auto": "The simplest model that explains the region",
    "dichromatic": "Body and surface reflection",
    "body": "Body reflection alone, for products that are almost gray",
}


def _spaces(_self: object, _context: object) -> list[tuple[str, str, str]]:
    if "spaces" not in _lists:
        from ..core.colorspace import SPACES

        as_told = (
            "FILE",
            "As the File Says",
            "The color space that the file names, or Blender's setting for the image",
        )
        _lists["spaces"] = [as_told, *((name, space.name, "") for name, space in SPACES.items())]
    return _lists["spaces"]


def _output_spaces(_self: object, _context: object) -> list[tuple[str, str, str]]:
    if "output spaces" not in _lists:
        from ..core.colorspace import SPACES

        own = ("PHOTO", "As the Photo", "The color space of the photo")
        _lists["output spaces"] = [own, *((name, space.name, "") for name, space in SPACES.items())]
    return _lists["output spaces"]


def _illuminants(_self: object, _context: object, typed: str) -> list[str]:
    from ..core import spectra

    names = spectra.illuminant_names()
    return [name for name in names if typed.lower() in name.lower()] or names


def _cameras(_self: object, _context: object, typed: str) -> list[str]:
    from ..core import spectra

    return [name for name in spectra.camera_names() if typed.lower() in name.lower()]


def _redraw(_self: object, _context: object) -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


def _note(owner: "DyehouseTarget | DyehouseRegion | DyehousePhoto") -> None:
    from . import picked_colors

    picked_colors.note(owner.id_data.dyehouse)


def _color_set(self: "DyehouseRegion | DyehousePhoto", context: object) -> None:
    _note(self)
    _redraw(self, context)


def _color_picked(self: "DyehouseTarget", context: object) -> None:
    """A color from the picker replaces what was typed; one dropped from another region brings its swatch along."""
    _note(self)
    if tuple(self.color) != tuple(self.shown) or not self.text:
        regions = self.id_data.dyehouse.regions
        alike = [r.target for r in regions if r.target.text and tuple(r.target.shown) == tuple(self.color)]
        self.text = alike[0].text if alike else ""
        self.swatch_name = alike[0].swatch_name if alike else ""
    _target_changed(self, context)


def _text_typed(self: "DyehouseTarget", context: object) -> None:
    """A typed color, or a swatch, shows in the color button too."""
    from . import recipes

    self.swatch_name = ""
    if self.text:
        self.shown = recipes.shown_color(self.text)
        if tuple(self.color) != tuple(self.shown):
            self.color = self.shown
    _target_changed(self, context)


def _target_changed(self: "DyehouseTarget", context: object) -> None:
    from . import colorways

    colorways.changed(self)
    _redraw(self, context)


def _colorway_chosen(self: "DyehousePhoto", context: object) -> None:
    from . import colorways

    colorways.chosen(self)
    _redraw(self, context)


def _found_color(self: "DyehouseRegion") -> tuple[float, ...]:
    """What the look at the photo found, without waiting for it."""
    from . import recipes

    return recipes.found_color(self.id_data, list(self.id_data.dyehouse.regions).index(self))


def _found_white(self: "DyehousePhoto") -> tuple[float, ...]:
    from . import recipes

    return recipes.found_white(self.id_data)


class DyehouseTarget(bpy.types.PropertyGroup):
    """A target color: as text where it was typed or came from a library, else as picked."""

    used: BoolProperty(
        name="Recolor", description="Put the region into this color", default=True, update=_target_changed
    )
    text: StringProperty(
        name="Color Value",
        description="#RRGGBB, lab(L, a, b), lch(L, C, h), xyz(X, Y, Z), rgb(r, g, b), or a CSV file of a spectrum",
        update=_text_typed,
    )
    color: FloatVectorProperty(
        name="Target",
        description="The color that the product shall have",
        subtype="COLOR",
        size=3,
        min=0,
        soft_max=1,
        default=(0.02, 0.1, 0.25),
        update=_color_picked,
    )
    shown: FloatVectorProperty(size=3, options={"HIDDEN"})
    swatch_name: StringProperty(name="Swatch", description="Name of the swatch in its library")


class DyehouseClick(bpy.types.PropertyGroup):
    """One more click of a clicked region."""

    pixel: IntVectorProperty(name="Pixel", size=2, default=NOWHERE)
    removes: BoolProperty(name="Remove", description="Take this material out of the region")


class DyehouseRegion(bpy.types.PropertyGroup):
    """One product, or one material of it."""

    name: StringProperty(name="Name", default="Product")
    reference_source: EnumProperty(name="Reference", items=REFERENCES, default="FOUND", update=_redraw)
    reference: IntVectorProperty(
        name="Pixel",
        description="Matte, lit pixel of the product, from the top left",
        size=2,
        default=NOWHERE,
        min=-1,
        update=_redraw,
    )
    reference_color: FloatVectorProperty(
        name="Color", subtype="COLOR", size=3, min=0, default=(0.5, 0.5, 0.5), update=_color_set
    )
    found_color: FloatVectorProperty(
        name="Color Found",
        description="The product's color at the reference",
        subtype="COLOR",
        size=3,
        get=_found_color,
    )
    mask_source: EnumProperty(
        name="Region", description="What belongs to the product", items=MASKS, default="CLICK", update=_redraw
    )
    click: IntVectorProperty(
        name="Click", description="Pixel that selects the product", size=2, default=NOWHERE, min=-1, update=_redraw
    )
    more_clicks: CollectionProperty(type=DyehouseClick)
    tolerance: FloatProperty(
        name="Tolerance",
        description="Accepted difference in color: 0.5 is strict, 2 is generous",
        default=1,
        min=0.05,
        soft_min=0.25,
        soft_max=4,
        max=20,
        update=_redraw,
    )
    mask_image: PointerProperty(
        name="Mask Image", description="White where the product is", type=bpy.types.Image, update=_redraw
    )
    mask_spline: PointerProperty(name="Mask", type=bpy.types.Mask, update=_redraw)
    mask_file: StringProperty(name="Mask File", subtype="FILE_PATH", options=RELATIVE, update=_redraw)
    matte_file: StringProperty(
        name="Cryptomatte File",
        description="Multilayer EXR with cryptomatte passes; empty for the photo itself",
        subtype="FILE_PATH",
        options=RELATIVE,
        update=_redraw,
    )
    matte_layer: StringProperty(name="Layer", description="Such as ViewLayer.CryptoObject", update=_redraw)
    matte_names: StringProperty(name="Names", description="Objects or materials, separated by commas", update=_redraw)
    model: EnumProperty(name="Model", items=_models, update=_redraw)
    residual: EnumProperty(
        name="Residual", description="What the model does not explain", items=RESIDUALS, update=_redraw
    )
    meaning: EnumProperty(name="Meaning", items=MEANINGS, update=_redraw)
    spill: BoolProperty(
        name="Recolor Spill",
        description="Recolor what shows of the product outside the region too: its rim, and the light that it throws "
        "on a neutral surround",
        update=_redraw,
    )
    source: StringProperty(
        name="Present Color",
        description="The product's present color, if it is known; #RRGGBB, lab(L, a, b) or a spectrum",
        update=_redraw,
    )
    target: PointerProperty(type=DyehouseTarget)


class DyehouseColorway(bpy.types.PropertyGroup):
    """A named set of targets, one for each region."""

    name: StringProperty(name="Name", default="Colorway")
    targets: CollectionProperty(type=DyehouseTarget)


class DyehousePhoto(bpy.types.PropertyGroup):
    """All that is asked of one photo."""

    color_space: EnumProperty(name="Color Space", description="What the photo's numbers mean", items=_spaces)
    white_source: EnumProperty(
        name="White", description="The light of the photo", items=WHITES, default="BALANCED", update=_redraw
    )
    white_pixel: IntVectorProperty(
        name="Pixel", description="On a white or gray card", size=2, default=NOWHERE, min=-1, update=_redraw
    )
    gray: FloatProperty(
        name="Card Reflectance",
        description="1 for a white card, 0.18 for a gray one",
        default=1,
        min=0.01,
        max=1,
        update=_redraw,
    )
    white_color: FloatVectorProperty(name="White", subtype="COLOR", size=3, min=0, default=(1, 1, 1), update=_color_set)
    white_illuminant: StringProperty(
        name="Illuminant",
        description="A standard light, a temperature, a mixture, or a CSV file of wavelength and power",
        default="D65",
        search=_illuminants,
        search_options={"SUGGESTION"},
        update=_redraw,
    )
    white_temperature: FloatProperty(
        name="Temperature",
        description="Color temperature in kelvin",
        default=5500,
        min=1700,
        max=25000,
        step=10000,
        precision=0,
        update=_redraw,
    )
    found_white: FloatVectorProperty(
        name="White Found",
        description="A perfect white in the photo's light",
        subtype="COLOR",
        size=3,
        get=_found_white,
    )
    light_source: EnumProperty(
        name="New Light", description="The light to show the product in", items=LIGHTS, default="SAME", update=_redraw
    )
    light_illuminant: StringProperty(
        name="Illuminant",
        description="A standard light, a temperature, a mixture, or a CSV file of wavelength and power",
        default="A",
        search=_illuminants,
        search_options={"SUGGESTION"},
        update=_redraw,
    )
    light_temperature: FloatProperty(
        name="Temperature",
        description="Color temperature in kelvin",
        default=3000,
        min=1700,
        max=25000,
        step=10000,
        precision=0,
        update=_redraw,
    )
    light_color: FloatVectorProperty(name="Light", subtype="COLOR", size=3, min=0, default=(1, 1, 1), update=_color_set)
    observer: EnumProperty(name="Observer", description="For spectra and lights", items=OBSERVERS, update=_redraw)
    adaptation: EnumProperty(
        name="Adaptation", description="For colors given under another white", items=ADAPTATIONS, update=_redraw
    )
    camera: StringProperty(
        name="Camera",
        description="Sensitivities of a known camera, for spectra and lights; or a CSV file",
        search=_cameras,
        search_options={"SUGGESTION"},
        update=_redraw,
    )
    colors_in: StringProperty(
        name="Colors In", description="Working space that the picked colors are in", options={"HIDDEN"}
    )
    regions: CollectionProperty(type=DyehouseRegion)
    active_region: IntProperty(name="Region", update=_redraw)
    colorways: CollectionProperty(type=DyehouseColorway)
    active_colorway: IntProperty(name="Colorway", default=-1, update=_colorway_chosen)
    preview: BoolProperty(
        name="Preview", description="Show the recolored photo in the editor; nothing is written", update=_redraw
    )
    view: EnumProperty(name="View", items=VIEWS, update=_redraw)
    split: FloatProperty(name="Split", subtype="FACTOR", default=0.5, min=0, max=1, update=_redraw)
    overlay: EnumProperty(name="Overlay", items=OVERLAYS, update=_redraw)
    overlay_opacity: FloatProperty(name="Opacity", subtype="FACTOR", default=0.6, min=0, max=1, update=_redraw)
    output_pattern: StringProperty(
        name="Output",
        description="Name of the files; {photo} and {colorway} are filled in",
        subtype="FILE_PATH",
        options=RELATIVE,
        default="//{photo}-{colorway}.png",
    )
    output_space: EnumProperty(
        name="Color Space",
        description="Of the files; a wide one holds colors that the photo's own cannot",
        items=_output_spaces,
        update=_redraw,
    )
    overwrite: BoolProperty(name="Overwrite", description="Replace files that are there")
    quality: IntProperty(name="Quality", description="Of JPEG and WebP files", default=95, min=1, max=100)


class DyehouseCatalog(bpy.types.PropertyGroup):
    """A catalog: many photos, by a recipe or a table."""

    jobs: StringProperty(
        name="Recipe or Table",
        description="Recipe (.toml), or table (.csv, .tsv, .jsonl) with a row for each photo",
        subtype="FILE_PATH",
        options=RELATIVE,
    )
    output: StringProperty(name="Output", description="Folder of the results", subtype="DIR_PATH", options=RELATIVE)
    existing: EnumProperty(
        name="Earlier Results", description="What is done about results that are there", items=EXISTING
    )
    max_error: FloatProperty(
        name="Largest Error",
        description="Predicted CIEDE2000 above which a result is set aside for a person; 0 to set none aside",
        min=0,
        soft_max=10,
        precision=1,
    )


CLASSES = (DyehouseTarget, DyehouseClick, DyehouseRegion, DyehouseColorway, DyehousePhoto, DyehouseCatalog)
_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Put the settings on images, and those of catalogs on scenes."""
    _register()
    bpy.types.Image.dyehouse = PointerProperty(type=DyehousePhoto)
    bpy.types.Scene.dyehouse_catalog = PointerProperty(type=DyehouseCatalog)


def unregister() -> None:
    """Take them away again."""
    del bpy.types.Scene.dyehouse_catalog, bpy.types.Image.dyehouse
    _unregister()
    _lists.clear()
