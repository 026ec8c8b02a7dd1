# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's evaluated data to relief's scene format (docs/scene_format.md). Start with scene.py."""
