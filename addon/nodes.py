"""The live node group "Dyehouse Recolor", for materials and for the compositor.

Both are the same nodes: the arithmetic of `core.mixture.Mixture.matrix`, written out so that the target, its light and
the share of the residual stay live. A keyframe or a driver on the target gives the pixels that the core gives for that
color. What depends on the picture alone, the weights that turn a pixel into its coefficients, are inputs too:

    a, b, c, l = weights . pixel (+ corrections of a, b, c from a map)
    pixel' = a V' + b W' + c bounce(V') + l L V' + channel weights * pixel * V'
    pixel' += r W'/W (pixel - the same sum for V and W)

The share ``r`` of the residual fades with the angle between V/W and V'/W' as in `dichromatic.carried_residual`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..core.mixture import Mixture

NAME = "Dyehouse Recolor"
TREES = {"SHADER": "ShaderNodeTree", "COMPOSITOR": "CompositorNodeTree"}
# Where a group keeps the picture's RGB space; it marks the group as one of ours.
_MARK = "dyehouse_space"
WORKING = "working"

# Name, type, default, tip; the first is called Color in materials and Image in the compositor.
_MAIN = (
    ("Target Color", "NodeSocketColor", (0.02, 0.1, 0.25, 1), "Color that the product shall have at its reference"),
    ("Mask", "NodeSocketFloat", 1.0, "Coverage of the product, 1 where all of the pixel is product"),
)
_LIGHT = (
    ("Target White", "NodeSocketVector", (1, 1, 1), "Linear RGB of a perfect white diffuser in the new light"),
    ("Residual", "NodeSocketFloat", 1.0, "Share of what the model does not explain that goes over to the new color"),
    ("Fade Residual", "NodeSocketBool", True, "Less of the residual the more the target differs from the reference"),
)
_PICTURE = (
    ("Reference", "NodeSocketVector", (0.5, 0.2, 0.1), "Linear RGB of the product where it is matte and lit"),
    ("White", "NodeSocketVector", (1, 1, 1), "Linear RGB of a perfect white diffuser in the light of the picture"),
    ("Body Weights", "NodeSocketVector", (0, 0, 0), "What body reflection takes of red, green and blue"),
    ("Gloss Weights", "NodeSocketVector", (0, 0, 0), "What surface reflection takes of red, green and blue"),
    ("Bounce Weights", "NodeSocketVector", (0, 0, 0), "What light between folds takes of red, green and blue"),
    ("Feedback", "NodeSocketFloat", 0.0, "Share of the light between folds that comes back"),
    ("Light Weights", "NodeSocketVector", (0, 0, 0), "What a second light takes of red, green and blue"),
    ("Second Light", "NodeSocketVector", (1, 1, 1), "Color of the second light relative to the first"),
    ("Channel Weights", "NodeSocketVector", (0, 0, 0), "For metals: one over the reference"),
)
_MAPS = (
    ("Edge Light", "NodeSocketVector", (0, 0, 0), "Light of the product along its outline, beyond its share by mask"),
    (
        "Correction",
        "NodeSocketVector",
        (0, 0, 0),
        "What single pixels have of body, gloss and bounce beyond the weights",
    ),
)
_PANELS = ((None, _MAIN), ("New Light", _LIGHT), ("Picture", _PICTURE), ("Maps", _MAPS))
# Inputs that hold the weights of the terms of `core.mixture`.
_WEIGHTS = {"body": "Body Weights", "white": "Gloss Weights", "bounce": "Bounce Weights", "light": "Light Weights"}
# Terms whose coefficients a map can correct: its red, green and blue.
CORRECTED = ("body", "white", "bounce")

# As core.dichromatic and core.interreflection have them; tests compare the results.
_FADE_DEGREES = 10.0
_MOST_FEEDBACK = 0.9

# Of the live edge in the compositor: coverage that counts as none or all, the pixels around where the background is
# looked for, and how far below zero a share may come out before it is none.
_CLEAR, _RADIUS, _IMPOSSIBLE = 0.004, 6, 0.1

EDGE_NAME = "Dyehouse Edge Light"
_EDGE_MARK = "dyehouse_edge"


def groups(kind: str | None = None) -> Iterator[bpy.types.NodeTree]:
    """All recolor groups of this .blend that can be changed, of one kind ("SHADER" or "COMPOSITOR") or of both."""
    for group in bpy.data.node_groups:
        if group.library is None and _MARK in group and kind in (None, _kind(group)):
            yield group


def is_recolor(node: bpy.types.Node | None) -> bool:
    """Whether a node is one of our groups, linked from a library or not."""
    tree = getattr(node, "node_tree", None)
    return tree is not None and _MARK in tree


def ensure_group(kind: str, space: str = WORKING) -> bpy.types.NodeTree:
    """Find the recolor group, or build it.

    Parameters
    ----------
    kind
        "SHADER" or "COMPOSITOR".
    space
        RGB space of the picture, a key of `core.colorspace.SPACES`: least squares depend on it a little, so the group
        works in it, as the core does, whatever the .blend's working space is. "working" for renders.
    """
    for group in groups(kind):
        if group[_MARK] == space:
            return group
    group = bpy.data.node_groups.new(NAME, TREES[kind])
    group[_MARK] = space
    _make_sockets(group)
    _make_nodes(group)
    return group


def refresh() -> None:
    """Bring the groups up to the .blend's working space."""
    for group in groups():
        if group.get(_MARK + "_from") != bpy.data.colorspace.working_space:
            group.nodes.clear()
            _make_nodes(group)


def fill(
    node: bpy.types.Node,
    mixture: Mixture,
    target: ArrayLike,
    target_white: ArrayLike,
    residual: str | float = "fade",
) -> None:
    """Set a recolor node's inputs; all colors (3,) linear RGB in the picture's space."""
    inputs = node.inputs
    colors: dict[str, Any] = {"Reference": mixture.body, "White": mixture.white, "Target White": target_white}
    colors["Second Light"] = mixture.light
    by_channel = mixture.terms == ("red", "green", "blue")
    for term, name in _WEIGHTS.items():
        known = term in mixture.terms
        colors[name] = mixture.projector[mixture.terms.index(term), :3] if known else (0, 0, 0)
    colors["Channel Weights"] = mixture.projector[:, :3].diagonal() if by_channel else (0, 0, 0)
    for name, value in colors.items():
        inputs[name].default_value = tuple(float(v) for v in value)
    inputs["Feedback"].default_value = mixture.feedback
    shares = {"fade": 1.0, "keep": 1.0, "drop": 0.0}
    inputs["Residual"].default_value = shares[residual] if isinstance(residual, str) else residual
    inputs["Fade Residual"].default_value = residual == "fade"
    set_target(node, target)


def set_target(node: bpy.types.Node, target: ArrayLike) -> None:
    """Set the target color, (3,) linear RGB in the picture's space."""
    import numpy as np

    color = [float(v) for v in np.linalg.inv(_from_working(node.node_tree[_MARK])) @ np.asarray(target, float)]
    socket = node.inputs["Target Color"]
    beyond = socket.links[0].from_node if socket.is_linked else None
    if min(color) >= 0:
        if beyond is not None and beyond.get(_MARK):
            node.id_data.nodes.remove(beyond)
        socket.default_value = (*color, 1)
        return
    if beyond is None:
        beyond = node.id_data.nodes.new("ShaderNodeCombineXYZ")
        beyond[_MARK] = True
        beyond.label = "Target Color out of Gamut"
        beyond.location = node.location.x - 200, node.location.y - 200
        node.id_data.links.new(beyond.outputs[0], socket)
    if beyond.get(_MARK):
        for channel, value in zip(beyond.inputs, color, strict=True):
            channel.default_value = value


def _kind(group: bpy.types.NodeTree) -> str:
    return "COMPOSITOR" if group.bl_idname == TREES["COMPOSITOR"] else "SHADER"


def _make_sockets(group: bpy.types.NodeTree) -> None:
    interface = group.interface
    first = "Image" if _kind(group) == "COMPOSITOR" else "Color"
    interface.new_socket(first, in_out="OUTPUT", socket_type="NodeSocketColor")
    color = (first, "NodeSocketColor", (0.8, 0.8, 0.8, 1), "Picture of the product")
    for name, sockets in _PANELS:
        panel = None if name is None else interface.new_panel(name, default_closed=True)
        for label, kind, default, tip in (color, *sockets) if name is None else sockets:
            item = interface.new_socket(label, description=tip, in_out="INPUT", socket_type=kind, parent=panel)
            item.default_value = default
            if label in ("Mask", "Residual"):
                item.subtype, item.min_value, item.max_value = "FACTOR", 0, 1
            item.hide_value = name == "Maps"


class _Builder:
    """Adds nodes to a group, each in the column after its inputs."""

    def __init__(self, group: bpy.types.NodeTree) -> None:
        self.group = group
        self.columns: dict[str, int] = {}
        self.rows: dict[int, int] = {}

    def add(self, kind: str, *inputs: Any, **settings: Any) -> bpy.types.Node:
        """Add a node; inputs are sockets, numbers, vectors, or None for unused ones."""
        node = self.group.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        column = 0
        for socket, value in zip(node.inputs, inputs, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                self.group.links.new(value, socket)
                column = max(column, self.columns[value.node.name] + 1)
            elif value is not None:
                socket.default_value = value
        self.columns[node.name] = column
        row = self.rows[column] = self.rows.get(column, -1) + 1
        node.location = 180 * column, -180 * row
        return node

    def math(self, operation: str, *inputs: Any) -> bpy.types.NodeSocket:
        return self.add("ShaderNodeMath", *inputs, operation=operation).outputs[0]

    def vector(self, operation: str, *inputs: Any) -> bpy.types.NodeSocket:
        node = self.add("ShaderNodeVectorMath", *inputs, operation=operation)
        return node.outputs["Value" if operation in ("DOT_PRODUCT", "LENGTH") else "Vector"]

    def scale(self, vector: bpy.types.NodeSocket, factor: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        return self.vector("SCALE", vector, None, None, factor)

    def extreme(self, operation: str, vector: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Smallest or largest component."""
        x, y, z = self.add("ShaderNodeSeparateXYZ", vector).outputs
        return self.math(operation, self.math(operation, x, y), z)

    def transform(self, vector: bpy.types.NodeSocket, matrix: NDArray) -> bpy.types.NodeSocket:
        """Matrix (3, 3) times a vector; nothing to do for the identity."""
        import numpy as np

        if np.array_equal(matrix, np.eye(3)):
            return vector
        rows = [self.vector("DOT_PRODUCT", vector, tuple(row)) for row in matrix]
        return self.add("ShaderNodeCombineXYZ", *rows).outputs[0]


def _make_nodes(group: bpy.types.NodeTree) -> None:
    import numpy as np

    compositor = _kind(group) == "COMPOSITOR"
    to_picture = _from_working(group[_MARK])
    group[_MARK + "_from"] = bpy.data.colorspace.working_space
    build = _Builder(group)
    socket = build.add("NodeGroupInput").outputs
    image = socket["Image" if compositor else "Color"]
    pixel = build.transform(image, to_picture)
    target = build.transform(socket["Target Color"], to_picture)
    reference, white, light, mask = socket["Reference"], socket["White"], socket["Target White"], socket["Mask"]

    share = build.vector("ADD", build.scale(pixel, mask), socket["Edge Light"])
    weights = _coefficients(build, share, socket)
    synthesis = _mixed(build, weights, target, light, socket["Feedback"])
    left = build.vector("SUBTRACT", share, _mixed(build, weights, reference, white, socket["Feedback"]))
    left = build.vector("MULTIPLY", left, build.vector("DIVIDE", light, white))
    kept = build.math("MULTIPLY", socket["Residual"], _faded(build, reference, white, target, light, socket))
    change = build.vector("SUBTRACT", build.vector("ADD", synthesis, build.scale(left, kept)), share)
    end = build.vector("ADD", image, build.transform(change, np.linalg.inv(to_picture)))
    if compositor:  # a vector has no alpha
        alpha = build.add("CompositorNodeSeparateColor", image).outputs["Alpha"]
        end = build.add("CompositorNodeSetAlpha", end, alpha, "Replace Alpha").outputs[0]
    build.add("NodeGroupOutput", end)


def _coefficients(build: _Builder, pixel: bpy.types.NodeSocket, socket: Any) -> list[bpy.types.NodeSocket]:
    """Of the body color by channel, of the white, and of the bounce."""
    corrections = build.add("ShaderNodeSeparateXYZ", build.scale(socket["Correction"], socket["Mask"])).outputs
    body, gloss, bounce = (
        build.math("ADD", build.vector("DOT_PRODUCT", pixel, socket[_WEIGHTS[term]]), correction)
        for term, correction in zip(CORRECTED, corrections, strict=True)
    )
    second = build.scale(socket["Second Light"], build.vector("DOT_PRODUCT", pixel, socket[_WEIGHTS["light"]]))
    by_channel = build.vector("MULTIPLY_ADD", pixel, socket["Channel Weights"], second)
    return [build.vector("ADD", by_channel, body), gloss, bounce]


def _mixed(
    build: _Builder,
    weights: list[bpy.types.NodeSocket],
    body: bpy.types.NodeSocket,
    white: bpy.types.NodeSocket,
    feedback: bpy.types.NodeSocket,
) -> bpy.types.NodeSocket:
    """The pixel of a body color under a white; the bounce as `interreflection.bounced` has it."""
    rho = build.vector("MAXIMUM", build.vector("DIVIDE", body, white), (0.0, 0.0, 0.0))
    held = build.vector("MINIMUM", build.scale(rho, feedback), (_MOST_FEEDBACK,) * 3)
    again = build.vector("DIVIDE", build.vector("MULTIPLY", rho, rho), build.vector("SUBTRACT", (1.0, 1.0, 1.0), held))
    by_white = build.vector("ADD", build.scale(again, weights[2]), weights[1])
    return build.vector("MULTIPLY_ADD", body, weights[0], build.vector("MULTIPLY", white, by_white))


def _faded(
    build: _Builder,
    reference: bpy.types.NodeSocket,
    white: bpy.types.NodeSocket,
    target: bpy.types.NodeSocket,
    light: bpy.types.NodeSocket,
    socket: Any,
) -> bpy.types.NodeSocket:
    """`dichromatic.carried_residual`, or 1 if the residual shall not fade.

    The angle is found from sine and cosine together: from the cosine alone it would be a guess for near colors.
    """
    old, new = build.vector("DIVIDE", reference, white), build.vector("DIVIDE", target, light)
    sine = build.vector("LENGTH", build.vector("CROSS_PRODUCT", old, new))
    angle = build.math("DEGREES", build.math("ARCTAN2", sine, build.vector("DOT_PRODUCT", old, new)))
    steps = build.math("DIVIDE", angle, _FADE_DEGREES)
    by_angle = build.math("EXPONENT", build.math("MULTIPLY", build.math("MULTIPLY", steps, steps), -1.0))
    length = build.math("DIVIDE", build.vector("LENGTH", new), build.vector("LENGTH", old))
    share = build.math("MULTIPLY", by_angle, build.math("MINIMUM", length, 1.0))
    return build.add("ShaderNodeMix", socket["Fade Residual"], None, 1.0, share, data_type="FLOAT").outputs[0]


def _from_working(space: str) -> NDArray:
    """(3, 3) float64: linear RGB of the .blend's working space to that of a picture's space."""
    import numpy as np

    from ..core.colorspace import space_named
    from . import images, recipes

    if space == WORKING:
        return np.eye(3)
    working, picture = images.working_space(), space_named(space)
    return np.array([recipes.between(working, picture, axis) for axis in np.eye(3)]).T


def recolor_nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """Recolor nodes of a tree."""
    return [node for node in tree.nodes if is_recolor(node)]


def after(socket: bpy.types.NodeSocket) -> bpy.types.Node | None:
    """The recolor node that an output goes into, if there is one already."""
    return next((k.to_node for k in socket.links if is_recolor(k.to_node) and k.to_socket == k.to_node.inputs[0]), None)


def insert(socket: bpy.types.NodeSocket, places: Sequence[bpy.types.NodeSocket], space: str) -> bpy.types.Node:
    """Put a recolor node between an output and the inputs that it goes to; one that is there is used again.

    Parameters
    ----------
    socket
        Output of a texture, an image or a render layer.
    places
        Inputs that shall have the new color.
    space
        As for :func:`ensure_group`.
    """
    tree = socket.id_data
    kind = "COMPOSITOR" if tree.bl_idname == TREES["COMPOSITOR"] else "SHADER"
    node = after(socket)
    if node is None:
        node = tree.nodes.new("CompositorNodeGroup" if kind == "COMPOSITOR" else "ShaderNodeGroup")
        node.name = node.label = NAME
        node.width = 200
        node.location = socket.node.location.x + socket.node.width + 40, socket.node.location.y
        node.node_tree = ensure_group(kind, space)
        for place in places:
            tree.links.new(node.outputs[0], place)
        tree.links.new(socket, node.inputs[0])
    elif node.node_tree[_MARK] != space:
        node.node_tree = ensure_group(kind, space)
    return node


def mixture_of(node: bpy.types.Node) -> tuple[Mixture, NDArray]:
    """What a recolor node is set to: a model whose corrections are those of `CORRECTED`, and its matrix.

    Returns
    -------
    mixture
        With three corrections.
    matrix
        (3, 6) recolor matrix at the current frame.

    Raises
    ------
    TargetError
        If the target comes from nodes that only a render can tell.
    """
    import numpy as np

    from ..core.dichromatic import carried_residual
    from ..core.mixture import Mixture

    value = {
        socket.name: np.array(socket.default_value[:3], float) for socket in node.inputs if socket.type == "VECTOR"
    }
    terms = tuple(_WEIGHTS)
    projector = np.hstack([np.stack([value[name] for name in _WEIGHTS.values()]), np.eye(4, 3)])
    if value["Channel Weights"].any():
        terms, projector = ("red", "green", "blue"), np.hstack([np.diag(value["Channel Weights"]), np.zeros((3, 3))])
    feedback = node.inputs["Feedback"].default_value
    body, white, light = value["Reference"], value["White"], value["Target White"]
    mixture = Mixture("dichromatic", body, white, terms, projector, feedback, value["Second Light"])
    target, residual = _target_of(node), node.inputs["Residual"].default_value
    if node.inputs["Fade Residual"].default_value:
        residual *= carried_residual(body, target, white, light)
    return mixture, mixture.matrix(target, light, residual)


def _target_of(node: bpy.types.Node) -> NDArray:
    from ..core.errors import TargetError

    socket = node.inputs["Target Color"]
    color = list(socket.default_value)[:3]
    if socket.is_linked:
        source = socket.links[0].from_node
        if _MARK not in source:
            raise TargetError(
                f"The Target Color of '{node.name}' comes from '{source.name}': give the target by itself."
            )
        color = [channel.default_value for channel in source.inputs]
    return _from_working(node.node_tree[_MARK]) @ color


def map_of(node: bpy.types.Node, name: str) -> bpy.types.Image | None:
    """The image that an input of a recolor node comes from; None for an input that has its usual value.

    Raises
    ------
    MaskError
        If it comes from something else.
    """
    from ..core.errors import MaskError

    socket = node.inputs[name]
    if not socket.is_linked:
        if name == "Mask" and socket.default_value != 1:
            raise MaskError(f"The Mask of '{node.name}' is not 1: set it to 1, or give it an image.")
        return None
    image = getattr(socket.links[0].from_node, "image", None)
    if image is None:
        raise MaskError(f"The {name} of '{node.name}' comes from no image: give the mask by itself.")
    return image


def remove(node: bpy.types.Node) -> None:
    """Take a recolor node out; what went into it goes where its result went. Its own helpers go with it."""
    tree = node.id_data
    before = node.inputs[0].links[0].from_socket if node.inputs[0].is_linked else None
    _unfeed(node)
    for link in node.inputs["Target Color"].links:
        if _MARK in link.from_node:
            _discard(link.from_node)
            break
    for place in [k.to_socket for k in node.outputs[0].links]:
        if before is not None:
            tree.links.new(before, place)
    tree.nodes.remove(node)


def feed(node: bpy.types.Node, maps: dict[str, bpy.types.Image]) -> None:
    """Give a recolor node the maps of its inputs; earlier ones of ours go.

    In a material they are laid out as the texture before the node is.
    """
    tree, source = node.id_data, node.inputs[0].links[0].from_node
    _unfeed(node)
    for row, (name, image) in enumerate(maps.items(), 1):
        image[_MARK] = True
        kind = "ShaderNodeTexImage" if _kind(tree) == "SHADER" else "CompositorNodeImage"
        helper = _helper(tree, kind, f"Dyehouse {name}", (source.location.x, source.location.y - 300 - 50 * row))
        helper.hide, helper.image = True, image
        if kind == "ShaderNodeTexImage":
            for setting in ("interpolation", "extension", "projection", "projection_blend"):
                setattr(helper, setting, getattr(source, setting))
            for link in source.inputs["Vector"].links:
                tree.links.new(link.from_socket, helper.inputs["Vector"])
        tree.links.new(helper.outputs[0], node.inputs[name])


def _helper(tree: bpy.types.NodeTree, kind: str, label: str, location: tuple[float, float]) -> bpy.types.Node:
    helper = tree.nodes.new(kind)
    helper[_MARK] = True
    helper.label, helper.location = label, location
    return helper


def _unfeed(node: bpy.types.Node) -> None:
    """Take the maps away that we gave to a recolor node."""
    for name in ("Mask", *(item[0] for item in _MAPS)):
        for link in node.inputs[name].links:
            if _MARK in link.from_node:
                _discard(link.from_node)
                break


def _discard(helper: bpy.types.Node) -> None:
    """Remove a node of ours, and its map if nothing else uses it."""
    image = getattr(helper, "image", None)
    helper.id_data.nodes.remove(helper)
    if image is not None and _MARK in image and not image.users:
        bpy.data.images.remove(image)


def feed_matte(node: bpy.types.Node, kind: str, **settings: Any) -> bpy.types.Node:
    """Give a recolor node of the compositor a mask from a new node, and the light in its soft edge; after `feed`.

    Parameters
    ----------
    node
        The recolor node.
    kind
        Type of the mask's node.
    settings
        Attributes of the mask's node.

    Returns
    -------
    The mask's node.
    """
    tree, picture = node.id_data, node.inputs[0].links[0].from_socket
    x, y = node.location.x - 260, node.location.y
    source = _helper(tree, kind, "Dyehouse Mask", (x, y - 260))
    edge = _helper(tree, "CompositorNodeGroup", EDGE_NAME, (x, y - 520))
    edge.node_tree = _edge_group()
    for name, value in settings.items():
        setattr(source, name, value)
    if "Image" in source.inputs:
        tree.links.new(picture, source.inputs["Image"])
    matte = source.outputs["Matte" if "Matte" in source.outputs else 0]
    for start, end in (
        (picture, edge.inputs["Image"]),
        (matte, edge.inputs["Mask"]),
        (edge.outputs[0], node.inputs["Edge Light"]),
        (matte, node.inputs["Mask"]),
    ):
        tree.links.new(start, end)
    return source


def _edge_group() -> bpy.types.NodeTree:
    """The product's light in soft pixels of a matte, beyond their share of the light by coverage.

    The matte is believed, as `core.compositing.refine_outline` cannot be had in nodes: the background's part, by the
    mean of the clear pixels in a window, is taken off. Where that mean is missing or brighter than the pixel allows,
    the edge is blended by coverage.
    """
    for group in bpy.data.node_groups:
        if group.library is None and _EDGE_MARK in group:
            return group
    group = bpy.data.node_groups.new(EDGE_NAME, TREES["COMPOSITOR"])
    group[_EDGE_MARK] = True
    group.interface.new_socket("Edge Light", in_out="OUTPUT", socket_type="NodeSocketVector")
    group.interface.new_socket("Image", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Mask", in_out="INPUT", socket_type="NodeSocketFloat")
    build = _Builder(group)
    image, mask, _ = build.add("NodeGroupInput").outputs
    outside = build.math("SUBTRACT", 1.0, build.math("GREATER_THAN", mask, _CLEAR))
    pixel = build.vector("SCALE", image, None, None, 1.0)
    counted = build.add("CompositorNodeSetAlpha", build.scale(pixel, outside), outside, "Replace Alpha").outputs[0]
    blurred = build.add("CompositorNodeBlur", counted, (_RADIUS, _RADIUS), "Flat", True).outputs[0]
    count = build.add("CompositorNodeSeparateColor", blurred).outputs["Alpha"]
    background = build.scale(blurred, build.math("DIVIDE", 1.0, count))

    by_coverage = build.scale(pixel, mask)
    share = build.vector("SUBTRACT", pixel, build.scale(background, build.math("SUBTRACT", 1.0, mask)))
    zero = (0.0, 0.0, 0.0)
    least = build.extreme("MINIMUM", share)
    size = build.extreme("MAXIMUM", build.vector("ABSOLUTE", pixel))
    possible = build.math("GREATER_THAN", least, build.math("MULTIPLY", size, -_IMPOSSIBLE))
    possible = build.math("MULTIPLY", possible, build.math("GREATER_THAN", count, 1e-4))
    share = build.add("ShaderNodeMix", possible, None, None, None, by_coverage, share, data_type="VECTOR").outputs[1]
    share = build.vector("MAXIMUM", share, build.vector("MINIMUM", pixel, zero))
    share = build.vector("MINIMUM", share, build.vector("MAXIMUM", pixel, zero))
    soft = build.math("MULTIPLY", build.math("GREATER_THAN", mask, _CLEAR), build.math("LESS_THAN", mask, 1 - _CLEAR))
    build.add("NodeGroupOutput", build.scale(build.vector("SUBTRACT", share, by_coverage), soft))
    return group


def base_color_texture(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The image texture that a material's base color comes from, or None."""
    color = _base_color(tree)
    return None if color is None else next((n for n in _upstream(color) if n.bl_idname == "ShaderNodeTexImage"), None)


def color_places(texture: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Inputs that a texture's color goes to on its way to the base color; all, if it is not on that way."""
    places = [link.to_socket for link in texture.outputs["Color"].links]
    color = _base_color(texture.id_data)
    if color is None:
        return places
    way = set(_upstream(color))
    return [place for place in places if place == color or place.node in way] or places


def output_places(socket: bpy.types.NodeSocket) -> list[bpy.types.NodeSocket]:
    """Inputs that a picture of the compositor goes to on its way to the output; all, if it is not on that way."""
    places = [k.to_socket for k in socket.links if k.to_node.bl_idname != "CompositorNodeCryptomatteV2"]
    way = {node.name for node in shown(socket.id_data)}
    return [p for p in places if p.node.name in way or p.node.bl_idname == "NodeGroupOutput"] or places


def shown(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Nodes that the output of a compositor tree shows, nearest first."""
    for node in tree.nodes:
        if node.bl_idname == "NodeGroupOutput" and node.is_active_output:
            yield from _upstream(node.inputs[0])


def _base_color(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket | None:
    """Input for the base color of the first shader behind the material's output."""
    output = tree.get_output_node("ALL")
    if output is None:
        return None
    for node in _upstream(output.inputs["Surface"]):
        for name in ("Base Color", "Color"):
            if node.outputs and node.outputs[0].type == "SHADER" and name in node.inputs:
                return node.inputs[name]
    return None


def _upstream(socket: bpy.types.NodeSocket) -> Iterator[bpy.types.Node]:
    """Nodes that a socket's value comes from, nearest first, each once, colors before factors."""
    waiting, seen = [socket], set()
    while waiting:
        for link in waiting.pop(0).links:
            if link.from_node in seen:
                continue
            seen.add(link.from_node)
            yield link.from_node
            waiting += sorted(link.from_node.inputs, key=lambda s: s.type not in ("RGBA", "SHADER"))


@persistent
def _on_change(*_: object) -> None:
    refresh()


def register() -> None:
    """Follow the .blend's working space."""
    bpy.app.handlers.depsgraph_update_post.append(_on_change)
    bpy.app.handlers.load_post.append(_on_change)


def unregister() -> None:
    """Stop following."""
    bpy.app.handlers.load_post.remove(_on_change)
    bpy.app.handlers.depsgraph_update_post.remove(_on_change)
