"""Recolor a material's base color texture: live, by a node group, or for good, into a new image."""

from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

from .. import images, masks, nodes, properties, recipes, writing
from . import common, modal

if TYPE_CHECKING:
    from ...core.recipe import Prepared, Recipe
    from .. import textures

_UNSET = (0.0, 0.0, 0.0)


class RecipeArguments:
    """What a recolor of one product needs, as arguments of an operator."""

    reference: IntVectorProperty(
        name="Reference",
        description="Matte, lit pixel of the product, x and y from the top left; -1 to find the color by itself",
        size=2,
        default=properties.NOWHERE,
        min=-1,
    )
    reference_color: FloatVectorProperty(
        name="Reference Color",
        description="Linear RGB of the product in the picture's space, instead of a pixel; black for none",
        size=3,
        default=_UNSET,
    )
    white: StringProperty(
        name="White",
        description="Light of the picture: x,y of a white card, r,g,b, an illuminant such as D65, highlights; "
        "empty if it is balanced",
    )
    target: StringProperty(
        name="Color Value",
        description="#RRGGBB, lab(L, a, b), rgb(r, g, b) or a CSV file of a spectrum; empty for the color below",
    )
    target_color: FloatVectorProperty(
        name="Target",
        description="Color that the product shall have",
        subtype="COLOR",
        size=3,
        min=0,
        soft_max=1,
        default=(0.02, 0.1, 0.25),
    )
    illuminant: StringProperty(
        name="New Light", description="Illuminant such as A, or r,g,b; empty for an unchanged light"
    )
    model: EnumProperty(name="Model", items=properties._models)
    residual: EnumProperty(name="Residual", description="What the model does not explain", items=properties.RESIDUALS)

    def recipe(self, space: str, mask: str | None = None) -> "Recipe":
        """The arguments as a recipe for a picture of an RGB space.

        Raises
        ------
        DyehouseError
            If an argument cannot be understood.
        """
        from ...core.recipe import Recipe, Region

        region = Region(
            target=self.swatch(space),
            reference=self._reference(),
            mask=mask,
            model=self.model,
            residual=self.residual,
        )
        return Recipe((region,), _light(self.white), illuminant=_light(self.illuminant))

    def swatch(self, space: str) -> Any:
        """The target as a swatch."""
        from ...core.colorspace import space_named
        from ...core.swatches import Swatch, parse_target

        if self.target:
            return parse_target(self.target, recipes.folder_of(None))
        if space == nodes.WORKING:
            return Swatch.from_linear(tuple(self.target_color))
        return Swatch.from_linear(recipes.between(images.working_space(), space_named(space), self.target_color))

    def _reference(self) -> tuple[float, ...] | None:
        if any(self.reference_color):
            return tuple(self.reference_color)
        return None if tuple(self.reference) == properties.NOWHERE else tuple(self.reference)


def _light(text: str) -> str | tuple[float, ...] | None:
    """A white as it is written on the command line."""
    try:
        return tuple(float(part) for part in text.split(",")) if text else None
    except ValueError:
        return text


def fill(node: bpy.types.Node, prepared: "Prepared", index: int = 0) -> None:
    """Set a recolor node to what was found in a picture."""
    residual = prepared.recipe.regions[index].residual
    nodes.fill(node, prepared.analyses[index].mixture, prepared.target(index), prepared.target_white, residual)


class MaterialOperator:
    """Base of operators about a texture of a material.

    Material and node are given by name, or are those in context; scripts need no context at all.
    """

    poll_message_set: Any
    execute: Any

    material: StringProperty(
        name="Material", description="Name of the material; empty for the active one", options={"SKIP_SAVE"}
    )
    node: StringProperty(
        name="Node",
        description="Name of the Image Texture node; empty for the base color texture",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Gray the button out, with the reason, where there is no material to work on."""
        if context.area is None or context.area.type not in {"NODE_EDITOR", "PROPERTIES"}:
            return True
        material = material_in(context)
        if material is None:
            cls.poll_message_set("There is no active material")
        elif not material.is_editable or material.override_library:
            cls.poll_message_set("The material is linked from a library")
        else:
            return True
        return False

    def found_material(self, context: bpy.types.Context) -> bpy.types.Material:
        """The material.

        Raises
        ------
        RecipeError
            If there is none, or it cannot be changed.
        """
        from ...core.errors import RecipeError

        if self.material:
            material = bpy.data.materials.get((self.material, None)) or bpy.data.materials.get(self.material)
            if material is None:
                raise RecipeError(
                    f"There is no material '{self.material}': give the name of a material of this .blend."
                )
        else:
            material = material_in(context)
            if material is None:
                raise RecipeError("There is no active material: select an object that has one, or give its name.")
        return material

    def found_texture(self, material: bpy.types.Material) -> bpy.types.Node:
        """The Image Texture node, with an image.

        Raises
        ------
        ImageError
            If there is none.
        """
        from ...core.errors import ImageError

        tree = material.node_tree
        if self.node:
            texture = tree.nodes.get(self.node)
            if texture is None or texture.bl_idname != "ShaderNodeTexImage":
                raise ImageError(
                    f"Material '{material.name}' has no Image Texture node '{self.node}': check the node's name."
                )
        else:
            texture = nodes.base_color_texture(tree)
            if texture is None:
                raise ImageError(
                    f"The base color of material '{material.name}' comes from no image texture: add one, or give the "
                    "name of an Image Texture node."
                )
        if texture.image is None:
            raise ImageError(f"The Image Texture node '{texture.name}' has no image: choose one.")
        return texture

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Take the selected Image Texture node of the Shader Editor."""
        self.take_selected(context)
        return self.execute(context)

    def take_selected(self, context: bpy.types.Context) -> None:
        """Take the selected Image Texture node of the Shader Editor as the node, if none is given."""
        active = getattr(context, "active_node", None)
        if not self.node and active is not None and active.bl_idname == "ShaderNodeTexImage" and active.select:
            self.node = active.name


def material_in(context: bpy.types.Context) -> bpy.types.Material | None:
    """The material at hand: of the properties editor, of the Shader Editor, or of the active object."""
    if getattr(context, "material", None):
        return context.material
    shown = getattr(getattr(context, "space_data", None), "id", None)
    if isinstance(shown, bpy.types.Material):
        return shown
    return getattr(getattr(context, "object", None), "active_material", None)


def found_scene(context: bpy.types.Context, name: str = "") -> bpy.types.Scene:
    """The scene of this name, or the one in context.

    Raises
    ------
    RecipeError
        If there is none of that name.
    """
    from ...core.errors import RecipeError

    scene = bpy.data.scenes.get(name) if name else context.scene
    if scene is None:
        raise RecipeError(f"There is no scene '{name}': give the name of a scene of this .blend.")
    return scene


def editable(owner: bpy.types.ID) -> None:
    """Check that a material's or a scene's nodes can be changed.

    Raises
    ------
    RecipeError
        If they are linked from a library.
    """
    from ...core.errors import RecipeError

    if not owner.is_editable or owner.override_library:
        raise RecipeError(
            f"{owner.id_type.title()} '{owner.name}' is linked from a library: make it local with Object > Relations."
        )


class TextureArguments(MaterialOperator, RecipeArguments):
    """Arguments of a recolor of a texture."""

    mask: StringProperty(
        name="Mask",
        description="Name of an image, white where the product is; or click, or alpha; empty for the whole texture",
        options={"SKIP_SAVE"},
    )
    tile: IntProperty(
        name="Tile", description="UDIM tile that the pixels are in; 0 for the first", default=0, min=0, max=2000
    )
    image_settings: BoolProperty(
        name="Image's Own Settings",
        description="Take everything from the settings of the texture in the Image Editor",
    )

    def opened(self, image: bpy.types.Image) -> "textures.Texture":
        """The texture with a recipe of the arguments."""
        from .. import textures

        if self.image_settings:
            return _with_own_settings(image)
        words = self.mask in ("click", "alpha")
        mask = common.image_named(self.mask) if self.mask and not words else None
        recipe = self.recipe(textures.space_of(image), self.mask if words else None)
        return textures.Texture(image, recipe, mask, self.tile)

    def warn(self, prepared: "Prepared") -> None:
        """Tell what the user should know."""
        for warning in prepared.warnings:
            self.report({"WARNING"}, warning)  # type: ignore[attr-defined]


def _with_own_settings(image: bpy.types.Image) -> "textures.Texture":
    from ...core.errors import RecipeError
    from .. import textures

    if not image.dyehouse.regions:
        raise RecipeError(f"Image '{image.name}' has no settings yet: pick the product in the Image Editor's sidebar.")
    shape = images.shape_of(image)
    loaders = {name: source.load(shape) for name, source in masks.sources(image).items()}
    return textures.Texture(image, recipes.recipe_of(image), masks=loaders)


class DYEHOUSE_OT_recolor_texture(TextureArguments, bpy.types.Operator):
    """Put the material's base color texture into another color, live: its target can be animated and driven"""

    bl_idname = "dyehouse.recolor_texture"
    bl_label = "Recolor Texture"
    bl_options = {"REGISTER", "UNDO"}

    @common.reporting
    def execute(self, context: bpy.types.Context) -> None:
        """Insert the group, or set the one that is there."""
        from .. import textures

        material = self.found_material(context)
        editable(material)
        texture = self.found_texture(material)
        opened = self.opened(texture.image)
        try:
            prepared = opened.first
            index = texture.image.dyehouse.active_region if self.image_settings else 0
            maps = textures.map_images(opened, index, textures.straight(texture))
        finally:
            opened.close()
        node = nodes.insert(texture.outputs["Color"], nodes.color_places(texture), opened.space)
        fill(node, prepared, index)
        nodes.feed(node, maps)
        self.warn(prepared)


def _in_compositor(context: bpy.types.Context) -> bool:
    return getattr(context.space_data, "tree_type", "") == nodes.TREES["COMPOSITOR"]


class DYEHOUSE_OT_remove_recolor(MaterialOperator, bpy.types.Operator):
    """Take the recolor node out again, so that the texture or the render has its own color"""

    bl_idname = "dyehouse.remove_recolor"
    bl_label = "Remove Recolor"
    bl_options = {"REGISTER", "UNDO"}

    node: StringProperty(
        name="Node", description="Name of the group's node; empty for all of them", options={"SKIP_SAVE"}
    )
    scene: StringProperty(
        name="Scene",
        description="Name of the scene whose compositor is meant; empty for a material",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """As for materials; in the compositor there is always a scene."""
        return _in_compositor(context) or super().poll(context)

    @common.reporting
    def execute(self, context: bpy.types.Context) -> None:
        """Take it out."""
        from ...core.errors import RecipeError

        owner, tree = self._owner(context)
        editable(owner)
        found = [node for node in nodes.recolor_nodes(tree) if self.node in ("", node.name)] if tree else []
        if not found:
            raise RecipeError(
                f"'{owner.name}' has no recolor node{self.node and f' {self.node!r}'}: there is nothing to remove."
            )
        for node in found:
            nodes.remove(node)

    def _owner(self, context: bpy.types.Context) -> tuple[bpy.types.ID, bpy.types.NodeTree | None]:
        if not self.scene and (self.material or not _in_compositor(context)):
            material = self.found_material(context)
            return material, material.node_tree
        scene = found_scene(context, self.scene)
        return scene, scene.compositing_node_group


class _Job(modal.Job):
    """Bakes a texture; what it is for is known by names, as references do not outlive an undo."""

    def __init__(self, texture: "textures.Texture | textures.Live", material: str, node: str, image: str) -> None:
        super().__init__()
        self.texture, self.material, self.node, self.image = texture, material, node, image
        self.tiles: dict[int, textures.Baked] = {}

    def work(self) -> "dict[int, textures.Baked]":
        """Recolor all tiles."""
        return self.texture.bake(self.watch)

    def finish(self, made: "dict[int, textures.Baked]") -> bool:
        """Keep them for the image."""
        self.tiles = made
        return False

    def progress(self) -> tuple[float, int, str]:
        """Share of the texture that is baked."""
        return self._share, 1, "Stopping" if self.stopping else f"Baking {self.texture.name}"

    def rest(self) -> str:
        """Nothing."""
        return "no image was made"

    def close(self) -> None:
        """Remove the temporary files."""
        self.texture.close()


_SLOT = modal.Slot("A texture is being baked; Esc stops it")
progress = _SLOT.progress


class DYEHOUSE_OT_bake_texture(modal.JobOperator, TextureArguments, bpy.types.Operator):
    """Recolor the material's base color texture into a new image of the same size, depth and color space;
    a live recolor node on the texture says what is done, unless arguments do
    """

    bl_idname = "dyehouse.bake_texture"
    bl_label = "Bake Recolored Texture"
    bl_options = {"REGISTER", "UNDO"}

    slot = _SLOT
    name: StringProperty(
        name="Name",
        description="Name of the new image; empty for the texture's name and Recolored",
        options={"SKIP_SAVE"},
    )
    output: StringProperty(
        name="File",
        description="File to write, with <UDIM> for tiles; empty to pack the image into the .blend",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    use: BoolProperty(
        name="Use in Material", description="Put the new image in the place of the texture and its live group"
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Bake in a thread, while the window goes on."""
        self.take_selected(context)
        return super().invoke(context, event)

    def job(self, context: bpy.types.Context) -> "_Job":
        """Of the texture that the arguments or the context say."""
        from ...core.errors import DyehouseError
        from .. import textures

        material = self.found_material(context)
        if self.use:
            editable(material)
        node = self.found_texture(material)
        live = nodes.after(node.outputs["Color"])
        texture: textures.Texture | textures.Live
        if live is None or any(self.properties.is_property_set(name) for name in _ASKING):
            texture = self.opened(node.image)
        else:
            texture = textures.Live(node, live)
        if self.output:
            try:
                texture.check(common.absolute(self.output))
            except DyehouseError:
                texture.close()
                raise
        return _Job(texture, material.name, node.name, node.image.name)

    def ended(self, job: "_Job") -> None:
        """Make the image; until now nothing has changed."""
        from ...core.errors import RecipeError
        from .. import textures

        material = bpy.data.materials.get(job.material)
        node = material and material.node_tree.nodes.get(job.node)
        source = node and node.image
        if source is None or source.name != job.image:
            raise RecipeError(f"The texture of material '{job.material}' was changed meanwhile: bake again.")
        name = self.name or f"{writing.stem_of(source)} Recolored"
        output = common.absolute(self.output) if self.output else None
        image = textures.stored(name, job.tiles, source.source == "TILED", None, output)
        image.alpha_mode = source.alpha_mode
        image.use_fake_user = True  # or it would not be saved before something shows it
        if self.use:
            live = nodes.after(node.outputs["Color"])
            if live is not None:
                nodes.remove(live)
            node.image = image
        self.report({"INFO"}, f"Baked {image.name}")


# Arguments that say how to recolor.
_ASKING = (*RecipeArguments.__annotations__, "mask", "tile", "image_settings")

CLASSES = (DYEHOUSE_OT_recolor_texture, DYEHOUSE_OT_remove_recolor, DYEHOUSE_OT_bake_texture)
register, unregister = modal.registration(_SLOT, CLASSES)
