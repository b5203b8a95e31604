"""Pictures in files, without Blender: the command line and the catalog."""
