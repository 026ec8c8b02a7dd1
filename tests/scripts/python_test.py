"""python/relief.py: pictures and hits as a closed form has them. $RELIEF_BINARY is the program. Needs numpy."""

import base64
import json
import pathlib
import struct
import sys
import tempfile
import unittest

try:
    import numpy as np
except ImportError:
    print("python_test: numpy is missing; scripts/install_dependencies test installs it (python3-numpy)")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "python"))
import relief  # noqa: E402


def scene_file(folder):
    """A black triangle in the plane z = 0 that glows by (.25, .5, 1) and fills a camera's view."""
    corners = base64.b64encode(struct.pack("<9f", -9, -9, 0, 18, -9, 0, -9, 18, 0)).decode()
    gltf = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"emissiveFactor": [0.25, 0.5, 1], "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-9, -9, 0], "max": [18, 18, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64," + corners}],
    }
    path = pathlib.Path(folder, "glow.gltf")
    path.write_text(json.dumps(gltf), encoding="utf-8")
    return path


class Python(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.scene = relief.load(scene_file(self.temporary.name))
        self.view = {"spp": 2, "resolution": (8, 6), "look_from": (0, 0, 2), "look_at": (0, 0, 0), "filter": "box"}

    def test_a_picture(self):
        picture = self.scene.render(**self.view)
        self.assertEqual((picture.shape, picture.dtype), ((6, 8, 4), np.float32))
        np.testing.assert_allclose(picture[..., :3], np.broadcast_to([0.25, 0.5, 1], (6, 8, 3)), rtol=1e-6)

    def test_layers(self):
        layers = self.scene.render(layers=["depth", "normal", "samples", "position"], **self.view)
        self.assertEqual(set(layers), {"beauty", "depth", "normal", "samples", "position"})
        np.testing.assert_allclose(layers["normal"], np.broadcast_to([0, 0, 1], (6, 8, 3)), atol=1e-6)
        np.testing.assert_array_equal(layers["samples"], np.full((6, 8), 2, np.uint32))
        self.assertEqual(layers["depth"].shape, (6, 8))
        # Rows from the top, columns from the left.
        self.assertGreater(layers["position"][0, 0, 1], layers["position"][5, 0, 1])
        self.assertLess(layers["position"][0, 0, 0], layers["position"][0, 7, 0])

    def test_rays(self):
        hits = self.scene.trace([[1, 2, 3, 0, 0, -2], [30, 30, 3, 0, 0, -1], [0, 0, -1, 0, 0, 1]])
        np.testing.assert_array_equal(hits["hit"], [True, False, True])
        np.testing.assert_allclose(hits["t"], [1.5, np.nan, 1])
        np.testing.assert_allclose(hits["P"][0], [1, 2, 0], atol=1e-6)
        np.testing.assert_allclose(hits["uv"][0], [10 / 27, 11 / 27], rtol=1e-6)
        np.testing.assert_array_equal(hits["triangle"], [0, -1, 0])
        limited = self.scene.trace([[1, 2, 3, 0, 0, -1, 0, 2.5]])
        np.testing.assert_array_equal(limited["hit"], [False])

    def test_what_is_wrong_is_said(self):
        with self.assertRaisesRegex(relief.ReliefError, "nothing.gltf"):
            relief.load(pathlib.Path(self.temporary.name, "nothing.gltf"))
        with self.assertRaisesRegex(relief.ReliefError, "--spp: expected"):
            self.scene.render(spp=0)
        with self.assertRaisesRegex(ValueError, "n × 6"):
            self.scene.trace([1, 2, 3])


if __name__ == "__main__":
    unittest.main()
