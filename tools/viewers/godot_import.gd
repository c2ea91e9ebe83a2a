# What Godot 3 leaves out when it imports a baked room: set this file as the scene's *Custom Script* in its Import panel, and
# *Meshes > Compress* off, which would round linear colours to 8 bits.
tool
extends EditorScenePostImport

func post_import(scene):
	draw_colours(scene)
	return scene

func draw_colours(node):
	if node is MeshInstance:
		for s in range(node.mesh.get_surface_count()):
			node.mesh.surface_get_material(s).flags_unshaded = true
			node.mesh.surface_get_material(s).vertex_color_use_as_albedo = true
	for child in node.get_children():
		draw_colours(child)
