# Writes what Godot 3 imported, see godot.mjs: colours, second texture coordinates and materials of all meshes, and texels of pages.
extends SceneTree

func _init():
	var scene = load("res://room.glb").instance()
	var out = {"surfaces": [], "pages": []}
	surfaces(scene, out.surfaces)
	for k in range(99):
		var image = Image.new()
		if not File.new().file_exists("res://page-%d.exr" % k) or image.load("res://page-%d.exr" % k) != OK:
			break
		image.convert(Image.FORMAT_RGBAF)
		var raw = File.new()
		raw.open("res://page-%d.raw" % k, File.WRITE)
		raw.store_buffer(image.get_data())
		raw.close()
		out.pages.push_back([image.get_width(), image.get_height()])
	var file = File.new()
	file.open("res://found.json", File.WRITE)
	file.store_string(JSON.print(out))
	file.close()
	quit()

# Vertices of every surface as rows: place, colour, second coordinates. Binary, for numbers in text have six digits.
func surfaces(node, out):
	if node is MeshInstance:
		for s in range(node.mesh.get_surface_count()):
			var arrays = node.mesh.surface_get_arrays(s)
			var material = node.mesh.surface_get_material(s)
			var raw = File.new()
			raw.open("res://surface-%d.raw" % out.size(), File.WRITE)
			var places = arrays[Mesh.ARRAY_VERTEX]
			var colours = arrays[Mesh.ARRAY_COLOR]
			var seconds = arrays[Mesh.ARRAY_TEX_UV2]
			for k in range(places.size()):
				var c = colours[k] if colours else Color(0, 0, 0)
				var t = seconds[k] if seconds else Vector2()
				for x in [places[k].x, places[k].y, places[k].z, c.r, c.g, c.b, t.x, t.y]:
					raw.store_float(x)
			raw.close()
			out.push_back({"mesh": node.mesh.resource_name, "vertices": places.size(), "corners": arrays[Mesh.ARRAY_INDEX].size(),
				"unshaded": material.flags_unshaded, "coloured": material.vertex_color_use_as_albedo})
	for child in node.get_children():
		surfaces(child, out)
