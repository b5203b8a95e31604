"""Small scenes of products to open in Blender, and the script that makes them."""
