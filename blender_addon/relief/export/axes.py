# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where Blender's axes become glTF's.

Blender: right-handed, Z up, Y away from the front view. glTF: right-handed, Y up, Z towards the viewer.

    x_gltf = x_blender,  y_gltf = z_blender,  z_gltf = −y_blender

Scenes get one root node with this rotation; everything below it keeps Blender's own numbers, cameras and lights too, as
both conventions look along −Z. What comes back in world space (positions, normals) is turned back.
"""

import numpy as np

#: Row-major 4×4: glTF's world from Blender's world.
GLTF_FROM_BLENDER = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def blender_from_gltf(vectors):
    """World-space vectors of a picture in Blender's axes: arrays of shape (…, 3)."""
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def environment_rotation(angle):
    """relief's rotation of a lat-long map, for one that Blender's Mapping turns about Z.

    With a direction's azimuth a = atan2(y, x) in Blender's axes, Blender looks the map up at u = ½ − (a + angle) / 2π;
    relief, whose map is centred at −Z, Blender's +Y, at u = ¾ − (a − rotation) / 2π.

    @param  angle  radians by which the texture's direction is turned about Z
    @return        radians about glTF's +Y, counter-clockwise seen from above
    """
    return float(-angle - np.pi / 2)
