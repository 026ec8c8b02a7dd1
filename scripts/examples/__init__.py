"""The example scenes, one module a scene; `scripts/make_examples` writes them.

Read `gltf` (the file writer) first, then `meshes` and `images` (what goes into the file), then any scene. Only
the standard library is used, and every random number comes from a seeded generator: the same bytes each time.
"""
