"""What an export costs: seconds, bytes and memory for instances and for large meshes. Prints a Markdown table.

    BLENDER_USER_SCRIPTS=… blender -b --factory-startup --python tests/blender/measure_export.py

Not a test. Memory is what the process's largest size grew by during the export, copies that Blender itself makes included.
"""

import os
import resource
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import scenes  # noqa: E402


def _instances(side):
    """A plane of side² faces, each of which carries a ball of 48 faces."""
    carrier = scenes.add_plane(100, subdivisions=side)
    ball = scenes.add_sphere(0.1, segments=8)
    ball.parent = carrier
    carrier.instance_type = "FACES"


def _duplicates(number):
    """Objects that share a ball of 2,048 faces."""
    ball = scenes.add_sphere(0.3, segments=64)
    for x in range(number - 1):
        scenes.link(ball.data, "ball").location.x = x


def _slots(number):
    """A mesh of 160,801 vertices whose faces have materials of their own, in no order."""
    plane = scenes.add_plane(8, subdivisions=400)
    for _ in range(number - 1):
        plane.data.materials.append(scenes.diffuse())
    faces = len(plane.data.polygons)
    plane.data.polygons.foreach_set("material_index", [7919 * face % number for face in range(faces)])


def _peak_bytes():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _measure(name, build):
    scene = scenes.new_scene()
    # Only now: switching the add-on on imports it.
    from relief.exporter import export_frames

    scenes.add_camera()
    build()
    scene.frame_set(1)  # what Blender evaluates by itself is no part of the export
    with scenes.folder() as path:
        before = _peak_bytes()
        seconds = []
        for number in (1, 2):
            begin = time.perf_counter()
            export_frames(scene, f"{path}/{number}.gltf", [1])
            seconds.append(time.perf_counter() - begin)
        size = sum(os.path.getsize(os.path.join(where, n)) for where, _, names in os.walk(path) for n in names) / 2
        print(f"| {name} | {min(seconds):.2f} | {size / 1e6:.2f} | {(_peak_bytes() - before) / 2**20:.0f} |", flush=True)


print("| scene | seconds | MB written | MiB more |")
print("| --- | --- | --- | --- |")
for count, side in ((9, 3), (1024, 32), (99856, 316)):
    _measure(f"{count:,} instances", lambda: _instances(side))
_measure("2,000 linked duplicates", lambda: _duplicates(2000))
_measure("1,002,001 vertices with uv", lambda: scenes.add_plane(8, subdivisions=1000))
for count in (1, 20, 200):
    _measure(f"160,801 vertices, {count} material slots", lambda: _slots(count))
