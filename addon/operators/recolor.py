"""Recoloring and inspecting by explicit settings, in the words of the command line; the panel's are not touched."""

import json
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import properties, recipes, scripting, session, writing
from . import common


def _text(name: str, description: str, default: str = "", **options) -> object:
    return StringProperty(name=name, description=description, default=default, options=common.PATH, **options)


class _AskingOperator(common.ImageOperator):
    """Base of operators that take a whole recipe as arguments."""

    target: _text("Target", "Color: #RRGGBB, lab(L, a, b), ... or a CSV file of a spectrum")
    reference: _text("Reference", "x,y of a matte, lit pixel of the product, or r,g,b linear; empty to find it")
    click: _text("Click", "x,y of a pixel that selects the product")
    mask: _text("Mask", "Mask file, 'alpha', or 'click'; empty for the whole picture without a click")
    mask_image: _text("Mask Image", "Name of an image that is white where the product is")
    mask_spline: _text("Spline Mask", "Name of a mask of the mask editor")
    mask_objects: _text("Cryptomatte", "Objects or materials of the render, separated by commas")
    tolerance: FloatProperty(name="Tolerance", description="Of a clicked region", default=1, min=0.01)
    model: EnumProperty(name="Model", items=properties._models)
    residual: _text("Residual", "What the model does not explain: fade, keep, drop, or a share 0..1", "fade")
    meaning: EnumProperty(name="Meaning", items=properties.MEANINGS)
    spill: BoolProperty(
        name="Spill", description="Recolor what shows of the product outside the mask too", options={"SKIP_SAVE"}
    )
    source: _text("Present Color", "The product's present color, if it is known")
    regions: _text("Regions", "Several regions, one a line, such as: click=410,300 target=#222222")
    white: _text("White", "x,y of a white card; r,g,b; an illuminant; a temperature; 'highlights'; empty: balanced")
    gray: FloatProperty(name="Card Reflectance", default=1, min=0.01, max=1)
    illuminant: _text("New Light", "An illuminant, a temperature or r,g,b; empty for the light of the photo")
    observer: EnumProperty(name="Observer", items=properties.OBSERVERS)
    camera: _text("Camera", "Sensitivities, for spectra and illuminants: a name or a CSV file")
    adaptation: EnumProperty(name="Adaptation", items=properties.ADAPTATIONS)

    @classmethod
    def poll(cls, context):
        """Always: the image may be given by name."""
        return True

    def looked(self, context: bpy.types.Context) -> tuple[bpy.types.Image, session.Look]:
        """The image, and the look at it for these arguments."""
        from ...core.errors import MaskError
        from ...core.recipe import check

        image = common.image_of(context, self.image)
        asked = {name: getattr(self, name) for name in ARGUMENTS}
        named = {kind: asked.pop(name) for kind, name in _MASKS.items()}
        given = [f"{kind}:{name}" for kind, name in named.items() if name] + [asked["mask"]] * bool(asked["mask"])
        if len(given) > 1:
            raise MaskError("More than one mask is given: give one, or several regions.")
        asked |= {"mask": given[0] if given else None, "regions": _regions(asked["regions"])}
        asked |= {name: recipes.decimal(asked[name]) for name in ("tolerance", "gray")}
        recipe, sources = scripting.recipe_of(image, **asked)
        check(recipe)
        return image, session.look(image, recipe, sources)


ARGUMENTS = tuple(_AskingOperator.__annotations__)
# Kinds of masks that Blender has, and the arguments that name them.
_MASKS = {"image": "mask_image", "spline": "mask_spline", "objects": "mask_objects"}


def _regions(text: str) -> list[dict[str, str]]:
    """Regions of the command line's form, one a line."""
    from ...batch.cli import region_options

    return [region_options(line) for line in text.splitlines() if line.strip()]


class DYEHOUSE_OT_recolor(_AskingOperator, bpy.types.Operator):
    """Recolor a product by the arguments given, into a new image or a file; settings of the panel are not used"""

    bl_idname = "dyehouse.recolor"
    bl_label = "Recolor by Arguments"

    output: _text("Output", "File to write; empty for a new image", subtype="FILE_PATH")
    result: _text("Result", "Name of the new image; empty for the photo's with '-recolored'")
    overwrite: BoolProperty(name="Overwrite", description="Replace a file that is there", options={"SKIP_SAVE"})
    quality: IntProperty(name="Quality", description="Of JPEG and WebP files", default=95, min=1, max=100)
    compression: _text("Compression", "Of TIFF and EXR files, such as zip or none; empty for the photo's")
    output_space: _text("Output Space", "Color space of the file, such as display-p3; empty for the photo's")

    @common.reporting
    def execute(self, context):
        """Recolor it."""
        from ...batch.inspection import report, with_shares

        path = common.absolute(self.output) if self.output else None
        if path is not None:
            writing.check(path, common.image_of(context, self.image), self.overwrite)
        image, look = self.looked(context)
        if path is None:
            name = self.result or f"{writing.stem_of(image)}-recolored"
            made, shares = writing.to_image(look.photo, look.prepared, name)
            done = f"New image '{made.name}'"
        else:
            options = {"quality": self.quality, "compression": self.compression or None}
            photo = writing.in_space(look.photo, self.output_space)
            shares = writing.save(photo, look.prepared, path, overwrite=self.overwrite, **options)
            done = f"Wrote {path}"
        for warning in with_shares(report(look.photo, look.prepared), shares)["warnings"]:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, done)


class DYEHOUSE_OT_inspect(_AskingOperator, bpy.types.Operator):
    """Say what a recolor would do, without writing a picture: figures and warnings as JSON, and maps"""

    bl_idname = "dyehouse.inspect"
    bl_label = "Inspect by Arguments"

    output: _text("Output", "JSON file to write; empty for a text of the .blend", subtype="FILE_PATH")
    result: _text("Result", "Name of the text", "Dyehouse Report")
    maps: _text("Maps", "Folder for A, B, residual and predicted error as pictures", subtype="DIR_PATH")
    overwrite: BoolProperty(name="Overwrite", description="Replace files that are there", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Inspect it."""
        from ...batch import inspection
        from ...core.errors import FileError

        path = common.absolute(self.output) if self.output else None
        if path is not None and path.exists() and not self.overwrite:
            raise FileError(f"'{path}' exists already: choose another name, or allow it to be overwritten.")
        _, look = self.looked(context)
        figures = inspection.figures(look.photo, look.prepared)
        if self.maps:
            folder = common.absolute(self.maps)
            figures["maps"] = [str(p) for p in inspection.write_maps(look.prepared, folder, force=self.overwrite)]
        text = json.dumps(figures, indent=2)
        if path is None:
            block = bpy.data.texts.get(self.result) or bpy.data.texts.new(self.result)
            block.from_string(text)
        else:
            write_text(path, text)
        for warning in figures["warnings"]:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, f"Wrote {path}" if path else f"Text '{self.result}'")


def write_text(path: Path, text: str) -> None:
    """Write a text file; it appears under its name only when it is complete."""
    from ...core.errors import FileError

    temporary = path.with_name(f".{path.name}.part")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise FileError(f"'{path}' could not be written ({error.strerror}): check the disk and folder.") from None


CLASSES = (DYEHOUSE_OT_recolor, DYEHOUSE_OT_inspect)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
