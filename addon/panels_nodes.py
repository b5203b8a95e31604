"""Recolor nodes where materials and renders are made: sidebar of the node editors, and material properties."""

import bpy

from . import nodes
from .operators import texture as texture_operators

_SETTINGS = ("Target White", "Residual", "Fade Residual")


class _Split:
    layout: bpy.types.UILayout

    def draw(self, context):
        """Draw the panel."""
        self.layout.use_property_split, self.layout.use_property_decorate = True, True
        self.draw_split(context, self.layout)

    def draw_split(self, context, layout):
        """Draw the panel's own part."""
        raise NotImplementedError


class _OfTexture(_Split):
    bl_label = "Dyehouse"

    def draw_split(self, context, layout):
        """Draw what can be done with the texture."""
        material = texture_operators.material_in(context)
        texture = _texture(context, material)
        if texture is None or texture.image is None:
            layout.label(text="No base color texture", icon="INFO")
            return
        image = texture.image
        layout.label(text=image.name, icon="IMAGE_DATA", translate=False)
        node = nodes.after(texture.outputs["Color"])
        if node is None:
            _texture_operator(layout, "dyehouse.recolor_texture", texture)
            if image.dyehouse.regions:
                button = _texture_operator(layout, "dyehouse.recolor_texture", texture, "Recolor as in Image Editor")
                button.image_settings = True
            return
        _settings(layout, node)
        progress = texture_operators.progress()
        if progress is None:
            row = layout.row(align=True)
            _texture_operator(row, "dyehouse.bake_texture", texture, "Bake")
            _texture_operator(row, "dyehouse.bake_texture", texture, "Bake and Use").use = True
        else:
            layout.progress(factor=progress[0], text="Baking; Esc: Stop")
        layout.operator("dyehouse.remove_recolor").node = node.name


class DYEHOUSE_PT_shader(_OfTexture, bpy.types.Panel):
    """Recolor the texture of the material in the Shader Editor."""

    bl_space_type = "NODE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Dyehouse"

    @classmethod
    def poll(cls, context):
        """Show the panel for materials."""
        space = context.space_data
        return space.tree_type == nodes.TREES["SHADER"] and isinstance(space.id, bpy.types.Material)


class DYEHOUSE_PT_material(_OfTexture, bpy.types.Panel):
    """Recolor the texture of the active material."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        """Show the panel for materials."""
        return context.material is not None


class DYEHOUSE_PT_compositor(_Split, bpy.types.Panel):
    """Recolor the render."""

    bl_label = "Dyehouse"
    bl_space_type = "NODE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Dyehouse"

    @classmethod
    def poll(cls, context):
        """Show the panel for the compositor of a scene."""
        return context.space_data.tree_type == nodes.TREES["COMPOSITOR"]

    def draw_split(self, context, layout):
        """Draw what can be done with the render."""
        tree = context.scene.compositing_node_group
        found = nodes.recolor_nodes(tree) if tree else []
        if not found:
            layout.operator_context = "INVOKE_DEFAULT"
            layout.operator("dyehouse.add_compositor_group")
            return
        active = tree.nodes.active
        node = active if active in found else found[0]
        _settings(layout, node)
        button = layout.operator("dyehouse.remove_recolor")
        button.scene, button.node = context.scene.name, node.name


def _texture(context: bpy.types.Context, material: bpy.types.Material | None) -> bpy.types.Node | None:
    """The selected Image Texture node of a Shader Editor, else the one behind the base color."""
    if material is None:
        return None
    active = getattr(context, "active_node", None)
    if active is not None and active.bl_idname == "ShaderNodeTexImage" and active.select:
        return active
    return nodes.base_color_texture(material.node_tree)


def _texture_operator(
    layout: bpy.types.UILayout, name: str, texture: bpy.types.Node, text: str | None = None
) -> bpy.types.OperatorProperties:
    button = layout.operator(name) if text is None else layout.operator(name, text=text)
    button.node = texture.name
    return button


def _settings(layout: bpy.types.UILayout, node: bpy.types.Node) -> None:
    """Inputs of a recolor node that are for the user; the others were found in the picture."""
    _input(layout, node, "Target Color")
    _input(layout, node, "Mask")
    header, body = layout.panel("dyehouse_light", default_closed=True)
    header.label(text="New Light")
    if body:
        for name in _SETTINGS:
            _input(body, node, name)


def _input(layout: bpy.types.UILayout, node: bpy.types.Node, name: str) -> None:
    socket = node.inputs[name]
    if not socket.is_linked:
        layout.prop(socket, "default_value", text=name)
        return
    source = socket.links[0].from_node
    row = layout.row()
    row.active = False
    row.label(text=name)
    row.label(text=source.label or source.name, translate=False)


CLASSES = (DYEHOUSE_PT_shader, DYEHOUSE_PT_material, DYEHOUSE_PT_compositor)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
