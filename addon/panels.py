"""The tab "Dyehouse" in the Image Editor's sidebar."""

import textwrap
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy

from . import recipes, session, swatches, thumbnails
from .operators import catalog, write
from .properties import NOWHERE

if TYPE_CHECKING:
    from ..core.colorspace import RGBSpace
    from ..core.gamut import Compromise
    from ..core.metamerism import Look as Appearance
    from ..core.metamerism import MetamerismIndex
    from ..core.swatches import Swatch
    from .properties import DyehousePhoto, DyehouseRegion

_PIXELS_PER_LETTER = 7.0

# CIEDE2000 under which a compromise is not worth a word.
_SEEN = 0.05


def photo_shown(context: bpy.types.Context) -> bpy.types.Image | None:
    """The image of the Image Editor at hand."""
    space = context.space_data
    return space.image if space and space.type == "IMAGE_EDITOR" else None


def active_region(asked: "DyehousePhoto") -> "DyehouseRegion | None":
    """The region that the panel shows."""
    return asked.regions[asked.active_region] if 0 <= asked.active_region < len(asked.regions) else None


def sentences(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE") -> None:
    """A label as long as it takes, in lines that fit the sidebar."""
    letters = context.region.width / (_PIXELS_PER_LETTER * context.preferences.system.ui_scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, max(20, int(letters) - 6))):
        column.label(text=line, icon=icon if number == 0 else "BLANK1" if icon != "NONE" else "NONE", translate=False)


# What `found` found since the window was drawn before, by the image's session_uid: every part of the panel asks.
_found: "dict[int, tuple[session.Look | None, str]]" = {}


def found(image: bpy.types.Image) -> "tuple[session.Look | None, str]":
    """What is known of the photo by now, and what stands in the way of knowing more; for drawing only."""
    from ..core.errors import DyehouseError

    if image.session_uid not in _found:
        try:
            _found[image.session_uid] = session.ready(image), ""
        except DyehouseError as error:
            _found[image.session_uid] = None, str(error)
        bpy.app.timers.register(_found.clear)  # which is after the drawing
    return _found[image.session_uid]


@lru_cache(maxsize=32)
def compromise(linear: tuple[float, ...], space: "RGBSpace") -> "Compromise":
    """The nearest color to linear RGB that a space can hold."""
    from ..core import gamut

    return gamut.nearest(linear, space)


@lru_cache(maxsize=32)
def under_lights(target: "Swatch", observer: str) -> "list[Appearance]":
    """The look of a spectral target under each light; raises a DyehouseError for others."""
    from ..core import metamerism

    return metamerism.under_lights(target, observer=observer)


@lru_cache(maxsize=32)
def metamerism_of(source: "Swatch | None", target: "Swatch", observer: str) -> "list[MetamerismIndex]":
    """The indices of a spectral target against the product's present color under the other lights.

    There are none where that is no spectrum.
    """
    from ..core import metamerism

    if source is None or metamerism.cannot_be_known(source):
        return []
    return metamerism.special_indices(source, target, observer=observer)


class DYEHOUSE_UL_regions(bpy.types.UIList):
    """Regions, each with its target."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        """Draw one region."""
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon="MATERIAL")
        target = row.row(align=True)
        target.enabled = item.target.used
        target.scale_x = 0.5
        target.prop(item.target, "color", text="")
        row.prop(item.target, "used", text="", icon="HIDE_OFF" if item.target.used else "HIDE_ON", emboss=False)


class DYEHOUSE_UL_colorways(bpy.types.UIList):
    """Named sets of targets."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        """Draw one colorway."""
        row = layout.row(align=True)
        picture = thumbnails.icon(data.id_data, index)
        row.prop(item, "name", text="", emboss=False, **({"icon_value": picture} if picture else {"icon": "COLOR"}))
        for target in item.targets:
            shown = row.row(align=True)
            shown.enabled = target.used
            shown.scale_x = 0.4
            shown.prop(target, "color", text="")


class _Tab:
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Dyehouse"


class DYEHOUSE_PT_photo(_Tab, bpy.types.Panel):
    """The photo, and how it is shown."""

    bl_label = "Dyehouse"

    def draw(self, context):
        """Draw the panel."""
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        image = photo_shown(context)
        if image is None:
            sentences(layout, context, "Open a photo of the product, or choose an image in the header")
            layout.operator("dyehouse.open_photo", icon="FILE_FOLDER")
            return
        asked = image.dyehouse
        row = layout.row(align=True)
        row.label(text=image.name, icon="IMAGE_DATA", translate=False)
        row.operator("dyehouse.open_photo", text="", icon="FILE_FOLDER")
        if not asked.regions:
            sentences(layout, context, "Click the product in the photo to begin")
            layout.operator("dyehouse.pick_region", text="Pick Product", icon="EYEDROPPER")
            return
        layout.prop(asked, "preview", toggle=True, icon="HIDE_OFF" if asked.preview else "HIDE_ON")
        shown = layout.column()
        shown.active = asked.preview
        shown.row().prop(asked, "view", expand=True)
        if asked.view == "SPLIT":
            shown.prop(asked, "split")
        look, problem = found(image)
        if problem:
            sentences(layout, context, problem, "ERROR")
        elif look is None:
            layout.label(text="Analyzing...", icon="TIME")
        for region in asked.regions if look else ():
            if waiting := recipes.unpicked(region):
                sentences(layout, context, waiting, "INFO")


class _Part(_Tab):
    bl_parent_id = "DYEHOUSE_PT_photo"
    layout: Any
    of_photo: Callable[..., None]

    @classmethod
    def poll(cls, context):
        """Show the part once there is a region."""
        image = photo_shown(context)
        return image is not None and len(image.dyehouse.regions) > 0

    def draw(self, context):
        """Draw the part for the photo."""
        self.layout.use_property_split, self.layout.use_property_decorate = True, False
        self.of_photo(context, self.layout, photo_shown(context))


class DYEHOUSE_PT_region(_Part, bpy.types.Panel):
    """What belongs to the product, and where its color is read."""

    bl_label = "Product"

    def of_photo(self, context, layout, image):
        """Draw the active region."""
        asked = image.dyehouse
        row = layout.row()
        row.template_list("DYEHOUSE_UL_regions", "", asked, "regions", asked, "active_region", rows=2)
        side = row.column(align=True)
        side.operator("dyehouse.add_region", text="", icon="ADD")
        side.operator("dyehouse.remove_region", text="", icon="REMOVE").index = asked.active_region
        if len(asked.regions) > 1:
            side.separator()
            side.operator("dyehouse.move_region", text="", icon="TRIA_UP").direction = "UP"
            side.operator("dyehouse.move_region", text="", icon="TRIA_DOWN").direction = "DOWN"
        region = active_region(asked)
        if region is None:
            return
        layout.prop(region, "mask_source")
        kind = region.mask_source
        if kind == "CLICK":
            layout.operator("dyehouse.pick_region", text="Pick Product", icon="EYEDROPPER")
            if region.more_clicks:
                layout.label(text=f"{len(region.more_clicks)} further clicks", translate=False)
            layout.prop(region, "tolerance")
        elif kind == "IMAGE":
            layout.template_ID(region, "mask_image", new="image.new", open="image.open")
        elif kind == "SPLINE":
            layout.template_ID(region, "mask_spline", new="mask.new")
        elif kind == "FILE":
            layout.prop(region, "mask_file")
        elif kind == "CRYPTOMATTE":
            layout.prop(region, "matte_file")
            layout.prop(region, "matte_layer")
            layout.prop(region, "matte_names")
        self._reference(context, layout, image, region)

    def _reference(self, context, layout, image, region):
        layout.separator()
        layout.prop(region, "reference_source")
        if region.reference_source == "COLOR":
            layout.prop(region, "reference_color")
        elif region.reference_source == "PIXEL":
            layout.prop(region, "reference")
        layout.operator("dyehouse.pick_reference", icon="EYEDROPPER")
        row = layout.row()
        row.enabled = False
        row.prop(region, "found_color")


def _light(layout: bpy.types.UILayout, asked: "DyehousePhoto", kind: str, name: str) -> None:
    """Draw the setting that says what a light is, the white of the photo's or the new one."""
    if kind in {"ILLUMINANT", "TEMPERATURE", "COLOR"}:
        layout.prop(asked, f"{name}_{kind.lower()}")


class DYEHOUSE_PT_white(_Part, bpy.types.Panel):
    """The light of the photo."""

    bl_label = "White"

    def of_photo(self, context, layout, image):
        """Draw where the white comes from."""
        asked = image.dyehouse
        kind = asked.white_source
        layout.prop(asked, "white_source", text="From")
        if kind == "PIXEL":
            if tuple(asked.white_pixel) != NOWHERE:
                layout.prop(asked, "white_pixel")
            layout.prop(asked, "gray", text="Reflectance")
        _light(layout, asked, kind, "white")
        layout.operator("dyehouse.pick_white", icon="EYEDROPPER")
        row = layout.row()
        row.enabled = False
        row.prop(asked, "found_white")
        look, _ = found(image)
        if look:
            sentences(layout, context, f"Source: {look.prepared.white_source}")


class DYEHOUSE_PT_target(_Part, bpy.types.Panel):
    """The color that the product shall have."""

    bl_label = "Target"

    def of_photo(self, context, layout, image):
        """Draw the target of the active region."""
        asked = image.dyehouse
        region = active_region(asked)
        if region is None:
            return
        layout.prop(region.target, "color")
        layout.prop(region.target, "text")
        if region.target.text:
            if region.target.swatch_name not in {"", region.target.text}:
                layout.label(text=region.target.swatch_name, icon="COLOR", translate=False)
            problem = recipes.problem_of(region.target, image)
            if problem:
                sentences(layout, context, problem, "ERROR")
        self._gamut(context, layout, image)
        layout.prop(region, "meaning")
        if region.meaning == "product":
            layout.prop(region, "source")
        layout.prop(asked, "light_source")
        _light(layout, asked, asked.light_source, "light")

    def _gamut(self, context, layout, image):
        look, _ = found(image)
        place = look.place(image.dyehouse.active_region) if look else None
        if look is None or place is None:
            return
        space = look.photo.wanted or look.photo.space
        nearest = compromise(tuple(recipes.between(look.photo.space, space, look.prepared.target(place))), space)
        if nearest.difference > _SEEN:
            row = layout.row()
            row.label(icon_value=swatches.icon_of_color(recipes.codes(nearest.linear, space)))
            text = f"{space.name} cannot hold this color: the nearest that it can is {nearest.difference:.1f} away"
            sentences(row, context, text)


class DYEHOUSE_PT_swatches(_Part, bpy.types.Panel):
    """The swatch book."""

    bl_label = "Swatches"
    bl_options = {"DEFAULT_CLOSED"}

    def of_photo(self, context, layout, image):
        """Draw the browser, and what can be done with its swatches."""
        region = active_region(image.dyehouse)
        if region is None:
            return
        layout.use_property_split = False
        state = swatches.browser()
        layout.row().prop(state, "listing", expand=True)
        if state.listing in {"LIBRARY", "NEAREST"}:
            layout.prop(state, "library", text="")
        if state.listing == "LIBRARY":
            layout.prop(state, "search", text="", icon="VIEWZOOM")
        self._grid(layout, state, _target(region, image))
        row = layout.row(align=True)
        row.operator("dyehouse.favorite_swatch", text="Add Favorite", icon="SOLO_ON")
        row.operator("dyehouse.favorite_swatch", text="", icon="SOLO_OFF").remove = True
        others = [k for k in range(len(image.dyehouse.regions)) if k != image.dyehouse.active_region]
        for other in others[:3]:
            copied = layout.operator(
                "dyehouse.copy_target", text=f"Copy Target to {image.dyehouse.regions[other].name}", icon="PASTEDOWN"
            )
            copied.to = other
        row = layout.row(align=True)
        row.operator("dyehouse.import_swatches", text="Import", icon="IMPORT")
        row.operator("dyehouse.export_swatches", text="Export", icon="EXPORT").library = (
            "" if state.library == "ALL" else state.library
        )
        if state.library != "ALL" and swatches.book().is_own(state.library):
            row.operator("dyehouse.remove_library", text="", icon="TRASH").library = state.library
        row = layout.row(align=True)
        row.prop_search(state, "palette", bpy.data, "palettes", text="", icon="COLOR")
        button = row.row(align=True)
        button.enabled = bool(state.palette)
        button.operator("dyehouse.swatches_from_palette", text="", icon="IMPORT").palette = state.palette
        button = row.row(align=True)
        button.enabled = state.library != "ALL"
        button.operator("dyehouse.swatches_to_palette", text="", icon="EXPORT").library = state.library
        for problem in swatches.book().problems:
            sentences(layout, context, problem, "ERROR")

    def _grid(self, layout, state, target):
        hits = swatches.shown(target)
        last = max(0, (len(hits) - 1) // swatches.PER_PAGE)
        page = min(state.page, last)
        part = hits[page * swatches.PER_PAGE : (page + 1) * swatches.PER_PAGE]
        if not part:
            layout.label(text="No swatches found" if state.listing == "LIBRARY" else "No swatches yet")
        named = state.listing == "NEAREST"
        grid = layout.column_flow(columns=1) if named else layout.grid_flow(columns=8, even_columns=True, align=True)
        for hit in part[: 10 if named else None]:
            text = f"{hit.difference:.1f}  {hit.swatch.text}" if named else ""
            button = grid.operator(
                "dyehouse.use_swatch", text=text, icon_value=swatches.icon_of(hit.swatch), translate=False
            )
            button.library, button.index = hit.library, hit.index
            button.listing = "" if hit.library else state.listing
        if last:
            row = layout.row(align=True)
            row.label(text=f"{len(hits)} swatches", translate=False)
            row.prop(state, "page", text=f"Page of {last + 1}")


class DYEHOUSE_PT_lights(_Part, bpy.types.Panel):
    """The target under other lights."""

    bl_label = "Under Other Lights"
    bl_options = {"DEFAULT_CLOSED"}

    def of_photo(self, context, layout, image):
        """Draw the look of the target under each light, or why it cannot be known."""
        from ..core.errors import DyehouseError

        region = active_region(image.dyehouse)
        target = _target(region, image) if region else None
        if target is None:
            return
        try:
            looks = under_lights(target, image.dyehouse.observer)
        except DyehouseError as error:
            sentences(layout, context, str(error), "INFO")
            return
        layout.prop(region, "source")
        indices = {index.test: index for index in self._metamerism(context, layout, image, region, target)}
        row = layout.row()
        for title in ("Light", "Shift", *(["Metamerism"] if indices else [])):
            row.label(text=title)
        for look in looks:
            row = layout.row()
            row.label(text=look.light, icon_value=swatches.icon_of_color(tuple(look.display)), translate=False)
            row.label(text=f"{look.shift:.1f}", translate=False)
            if indices:
                index = indices.get(look.light)
                row.label(text=f"{index.value:.1f}" if index else "", translate=False)
        for index in list(indices.values())[:1]:
            sentences(layout, context, f"Metamerism against the present color; {index.match}", "INFO")

    def _metamerism(self, context, layout, image, region, target):
        from ..core.errors import DyehouseError
        from ..core.swatches import parse_target

        try:
            source = parse_target(region.source, recipes.folder_of(image)) if region.source else None
            found = metamerism_of(source, target, image.dyehouse.observer)
        except DyehouseError as error:
            sentences(layout, context, str(error), "ERROR")
            return []
        if not found:
            sentences(layout, context, "For the metamerism index, give the present color as a spectrum", "INFO")
        return found


def _target(region: "DyehouseRegion", image: bpy.types.Image) -> "Swatch | None":
    """The active region's target, None while it cannot be understood."""
    from ..core.errors import DyehouseError

    try:
        return recipes.swatch_of(region.target, image)
    except DyehouseError:
        return None


class DYEHOUSE_PT_colorways(_Part, bpy.types.Panel):
    """Named sets of targets."""

    bl_label = "Colorways"

    def of_photo(self, context, layout, image):
        """Draw the list of colorways."""
        asked = image.dyehouse
        thumbnails.update(image)
        row = layout.row()
        row.template_list("DYEHOUSE_UL_colorways", "", asked, "colorways", asked, "active_colorway", rows=3)
        side = row.column(align=True)
        side.operator("dyehouse.add_colorway", text="", icon="ADD")
        side.operator("dyehouse.remove_colorway", text="", icon="REMOVE")
        side.operator("dyehouse.duplicate_colorway", text="", icon="DUPLICATE")
        side.separator()
        side.operator("dyehouse.move_colorway", text="", icon="TRIA_UP").direction = "UP"
        side.operator("dyehouse.move_colorway", text="", icon="TRIA_DOWN").direction = "DOWN"
        layout.operator("dyehouse.use_colorway", icon="IMPORT")


class DYEHOUSE_PT_write(_Part, bpy.types.Panel):
    """New images and files."""

    bl_label = "Write"

    def of_photo(self, context, layout, image):
        """Draw what can be written."""
        asked = image.dyehouse
        layout.operator("dyehouse.write_file", icon="FILE_TICK")
        layout.operator("dyehouse.write_image", icon="IMAGE_DATA")
        column = layout.column()
        column.prop(asked, "output_pattern")
        column.prop(asked, "quality")
        column.prop(asked, "output_space")
        column.prop(asked, "overwrite")
        column.operator("dyehouse.write_colorways", icon="RENDERLAYERS")
        progress = write.progress()
        if progress:
            done, total, text = progress
            column.progress(factor=done / total, type="BAR", text=text, translate=False)
        for sentence in write.delivered(image):
            sentences(layout, context, sentence, "CHECKMARK")
        row = layout.row(align=True)
        row.operator("dyehouse.save_recipe", icon="EXPORT")
        row.operator("dyehouse.load_recipe", icon="IMPORT")


class DYEHOUSE_PT_diagnostics(_Part, bpy.types.Panel):
    """How well the model holds."""

    bl_label = "Diagnostics"
    bl_options = {"DEFAULT_CLOSED"}

    def of_photo(self, context, layout, image):
        """Draw overlays, the model in use, and warnings."""
        asked = image.dyehouse
        layout.prop(asked, "overlay")
        row = layout.row()
        row.active = asked.overlay != "NONE"
        row.prop(asked, "overlay_opacity")
        look, _ = found(image)
        analysis = look.analysis(asked.active_region) if look else None
        if analysis is None:
            return
        report: dict[str, Any] = analysis.report
        column = layout.column(align=True)
        for label, value in (
            ("Model", str(report["model"]).replace("_", " ").title()),
            ("Noise Gain", "{:.1f}".format(report["noise_gain"]) if report["noise_gain"] else "Unbounded"),
            ("Residual", "{:.2f} of 255".format(report["residual_mean"])),
            ("Clipped", "{:.1%}".format(report["clipped_share"])),
        ):
            split = column.split(factor=0.4)
            split.alignment = "RIGHT"
            split.label(text=label)
            split.label(text=value, translate=False)


class DYEHOUSE_PT_advanced(_Part, bpy.types.Panel):
    """What is rarely changed."""

    bl_label = "Advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def of_photo(self, context, layout, image):
        """Draw the settings."""
        asked = image.dyehouse
        region = active_region(asked)
        if region is not None:
            layout.prop(region, "model")
            layout.prop(region, "residual")
            layout.prop(region, "spill")
        layout.prop(asked, "color_space")
        layout.prop(asked, "camera")
        layout.prop(asked, "observer")
        layout.prop(asked, "adaptation")
        look, _ = found(image)
        place = look.place(asked.active_region) if look else None
        if look is None or place is None:
            return
        recipe = look.prepared.recipe
        swatch, light = recipe.regions[place].target, recipe.illuminant if isinstance(recipe.illuminant, str) else None
        if swatch is not None:
            fate = swatch.fate(look.photo.space, light, recipe.observer, recipe.camera, recipe.adaptation)
            sentences(layout, context, fate, "INFO")


class DYEHOUSE_PT_catalog(_Tab, bpy.types.Panel):
    """Many photos, by a recipe or a table."""

    bl_label = "Catalog"
    bl_parent_id = "DYEHOUSE_PT_photo"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        """Draw what is asked for, how far it is, and what came of it."""
        layout, asked = self.layout, context.scene.dyehouse_catalog
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("jobs", "output", "existing", "max_error"):
            layout.prop(asked, name)
        row = layout.row(align=True)
        row.operator("dyehouse.check_batch", icon="CHECKMARK")
        row.operator("dyehouse.run_batch", icon="PLAY")
        progress, outcome = catalog.progress(), catalog.outcome()
        if progress:
            done, total, text = progress
            layout.progress(factor=done / total, type="BAR", text=text, translate=False)
        if outcome:
            sentences(layout, context, outcome.sentence, "INFO")
            for problem in outcome.named:
                sentences(layout, context, problem, "ERROR")
            if outcome.page:
                layout.operator("wm.url_open", text="Open Page of the Run", icon="URL").url = outcome.page.as_uri()


class DYEHOUSE_PT_warnings(_Part, bpy.types.Panel):
    """What may go wrong, in words."""

    bl_label = "Warnings"

    @classmethod
    def poll(cls, context):
        """Show the part when there is something to say."""
        image = photo_shown(context)
        if image is None or not image.dyehouse.regions:
            return False
        return bool(session.warnings(image, found(image)[0]))

    def of_photo(self, context, layout, image):
        """Draw the warnings of the photo's look."""
        for warning in session.warnings(image, found(image)[0]):
            sentences(layout, context, warning, "ERROR")


CLASSES = (
    DYEHOUSE_UL_regions,
    DYEHOUSE_UL_colorways,
    DYEHOUSE_PT_photo,
    DYEHOUSE_PT_warnings,
    DYEHOUSE_PT_region,
    DYEHOUSE_PT_white,
    DYEHOUSE_PT_target,
    DYEHOUSE_PT_swatches,
    DYEHOUSE_PT_lights,
    DYEHOUSE_PT_colorways,
    DYEHOUSE_PT_write,
    DYEHOUSE_PT_diagnostics,
    DYEHOUSE_PT_advanced,
    DYEHOUSE_PT_catalog,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
