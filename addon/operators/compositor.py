"""Recolor renders: the live node group in a scene's compositor."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import EnumProperty, StringProperty

from .. import images, nodes
from . import common
from .texture import RecipeArguments, editable, fill, found_scene

if TYPE_CHECKING:
    from ...core.recipe import Prepared
    from .. import textures

_SOURCES = {"CompositorNodeRLayers", "CompositorNodeImage"}

MATTES = (
    ("CryptoObject", "Objects", "Cryptomatte of objects"),
    ("CryptoMaterial", "Materials", "Cryptomatte of materials"),
    ("CryptoAsset", "Assets", "Cryptomatte of assets: objects with their children"),
)
_PASSES = {
    "CryptoObject": "use_pass_cryptomatte_object",
    "CryptoMaterial": "use_pass_cryptomatte_material",
    "CryptoAsset": "use_pass_cryptomatte_asset",
}


class DYEHOUSE_OT_add_compositor_group(RecipeArguments, bpy.types.Operator):
    """Put a product of the render into another color in the compositor, live: the target can be animated and driven"""

    bl_idname = "dyehouse.add_compositor_group"
    bl_label = "Recolor Render"
    bl_options = {"REGISTER", "UNDO"}

    scene: StringProperty(
        name="Scene", description="Name of the scene; empty for the active one", options={"SKIP_SAVE"}
    )
    node: StringProperty(
        name="Node",
        description="Name of the Render Layers or Image node; empty for the one that the output shows",
        options={"SKIP_SAVE"},
    )
    image: StringProperty(
        name="Read From",
        description="Image that pixels and found colors are read from; empty for the node's own, or the last render",
        options={"SKIP_SAVE"},
    )
    mask: StringProperty(
        name="Mask", description="Name of an image or a mask, white where the product is", options={"SKIP_SAVE"}
    )
    matte: StringProperty(
        name="Cryptomatte",
        description="Names of objects or materials, separated by commas, instead of a mask",
        options={"SKIP_SAVE"},
    )
    matte_layer: EnumProperty(name="Matte Layer", items=MATTES)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Gray the button out, with the reason, where the scene cannot be changed."""
        if context.area and context.scene and not context.scene.is_editable:
            cls.poll_message_set("The scene is linked from a library")
            return False
        return True

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Ask for the target and for what else is known."""
        return context.window_manager.invoke_props_dialog(self, width=360)

    @common.reporting
    def execute(self, context: bpy.types.Context) -> None:
        """Insert the group, or set the one that is there."""
        from .. import textures

        scene = found_scene(context, self.scene)
        editable(scene)
        tree = scene.compositing_node_group
        if tree is not None:
            editable(tree)
        source = self._source(tree) if tree is not None else None
        self._check_mask()
        space = self._space(source)
        mask, maps = None, {}
        texture = self._opened(source, space)
        if texture is None:
            prepared = self._without_picture(space)
        else:
            try:
                prepared = texture.first
                if space == nodes.WORKING:
                    prepared = _without_maps(prepared)
                else:
                    maps = textures.map_images(texture, 0, straight=False)
            finally:
                texture.close()
        if self.mask in bpy.data.images and not maps:
            mask = textures.coverage_image(common.image_named(self.mask))
        if source is None:
            source = _new_tree(scene)
        node = nodes.insert(source.outputs["Image"], nodes.output_places(source.outputs["Image"]), space)
        fill(node, prepared)
        nodes.feed(node, maps)
        self._feed(node, scene, mask)
        for warning in prepared.warnings:
            self.report({"WARNING"}, warning)

    def _source(self, tree: bpy.types.NodeTree) -> bpy.types.Node | None:
        """The node whose picture is recolored; None in a tree without any."""
        from ...core.errors import ImageError

        if self.node:
            node = tree.nodes.get(self.node)
            if node is None or node.bl_idname not in _SOURCES:
                raise ImageError(f"There is no Render Layers or Image node '{self.node}': check the node's name.")
            return node
        node = next((n for n in nodes.shown(tree) if n.bl_idname in _SOURCES), None)
        if node is None and any(n.bl_idname == "NodeGroupOutput" for n in tree.nodes):
            raise ImageError(f"The output of '{tree.name}' shows no render and no image: connect one, or name a node.")
        return node

    def _space(self, source: bpy.types.Node | None) -> str:
        from ...core.errors import ImageError
        from .. import textures

        if source is None or source.bl_idname == "CompositorNodeRLayers":
            return nodes.WORKING
        if source.image is None:
            raise ImageError(f"The Image node '{source.name}' has no image: choose one.")
        return textures.space_of(source.image)

    def _check_mask(self) -> None:
        from ...core.errors import MaskError

        if self.mask and self.matte:
            raise MaskError("Both a mask and a cryptomatte are given: leave one out.")
        if self.mask and self.mask not in bpy.data.images and self.mask not in bpy.data.masks:
            raise MaskError(f"There is no image and no mask '{self.mask}': check its name.")

    def _opened(self, source: bpy.types.Node | None, space: str) -> "textures.Texture | None":
        """The picture that colors are read from; None if the arguments have them all."""
        from ...core.errors import ImageError
        from .. import textures

        seen = self.white == "highlights" or self.white.count(",") == 1
        image = None
        if self.image:
            image = common.image_named(self.image)
        elif source is not None and space != nodes.WORKING:
            image = source.image
        elif any(self.reference_color) and not seen:
            return None
        else:
            image = bpy.data.images.get("Render Result")
        if image is None or (image.type == "RENDER_RESULT" and not image.has_data):
            raise ImageError(
                "There is no render to read the reference from: render first, give the image of a saved render, or "
                "give the reference as a color."
            )
        mask = common.image_named(self.mask) if self.mask in bpy.data.images else None
        return textures.Texture(image, self.recipe(space), mask)

    def _without_picture(self, space: str) -> "Prepared":
        import numpy as np

        from ...core.colorspace import space_named
        from ...core.picture import Picture
        from ...core.recipe import prepare

        known = images.working_space() if space == nodes.WORKING else space_named(space)
        return prepare(Picture(np.array([[self.reference_color]], np.float32)), self.recipe(space), space=known)

    def _feed(self, node: bpy.types.Node, scene: bpy.types.Scene, mask: bpy.types.Image | None) -> None:
        """Connect mask or matte of a render."""
        if mask is not None:
            nodes.feed_matte(node, "CompositorNodeImage", image=mask)
        elif self.mask in bpy.data.masks:
            source = nodes.feed_matte(node, "CompositorNodeMask", mask=bpy.data.masks[self.mask])
            source.inputs["Size Source"].default_value = "Scene Size"
        elif self.matte:
            _matte(node, scene, self.matte, self.matte_layer)


def _without_maps(prepared: "Prepared") -> "Prepared":
    """The same under a model that needs no maps of single pixels: those of one frame are of no use for the others."""
    from ...core.analysis import analyze

    (found,) = prepared.analyses
    if found.evidence.mixture.projector.shape[1] == 3:
        return prepared
    plain = analyze(found.picture, found.white, tuple(found.reference), found.selection, "dichromatic")
    return replace(prepared, analyses=(plain,))


def _new_tree(scene: bpy.types.Scene) -> bpy.types.Node:
    """Give the scene a compositor tree that shows its render, if it has none; returns the Render Layers node."""
    tree = scene.compositing_node_group
    if tree is None:
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", nodes.TREES["COMPOSITOR"])
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    layers, output = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("NodeGroupOutput")
    layers.scene = scene
    output.location.x = 600
    tree.links.new(layers.outputs["Image"], output.inputs[0])
    return layers


def _matte(node: bpy.types.Node, scene: bpy.types.Scene, names: str, layer: str) -> Any:
    """Connect a cryptomatte of the picture that goes into the node."""
    from ...core.errors import MaskError

    picture = node.inputs[0].links[0].from_node
    settings: dict[str, Any] = {"source": "RENDER", "scene": scene}
    if picture.bl_idname == "CompositorNodeImage":
        settings = {"source": "IMAGE", "image": picture.image}
    else:
        view_layer = scene.view_layers.get(picture.layer) or scene.view_layers[0]
        setattr(view_layer, _PASSES[layer], True)
    matte = nodes.feed_matte(node, "CompositorNodeCryptomatteV2", **settings)
    try:
        matte.layer_name = f"{(matte.layer_name or '.').rsplit('.', 1)[0]}.{layer}"
    except TypeError:
        raise MaskError(f"The picture has no pass {layer}: render it with cryptomatte, or give a mask.") from None
    matte.matte_id = names


CLASSES = (DYEHOUSE_OT_add_compositor_group,)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
