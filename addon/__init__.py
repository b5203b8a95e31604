"""The Blender side: everything that touches bpy, and nothing else."""
