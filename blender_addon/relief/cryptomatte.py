# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's Cryptomatte node looks for in a picture's metadata.

@source  https://github.com/Psyop/Cryptomatte/blob/master/specification
"""

import struct

_PREFIX = "cryptomatte/"


def metadata(attributes, layer_name):
    """Texts by name for a picture of Blender's, whose Cryptomattes are called after their view layer.

    @param  attributes  of the program's picture
    @param  layer_name  view layer
    """
    by_key = {}
    for name, text in attributes.items():
        if name.startswith(_PREFIX):
            _, key, field = name.split("/", 2)
            by_key.setdefault(key, {})[field] = text
    out = {}
    for fields in by_key.values():
        fields = {**fields, "name": f"{layer_name}.{fields['name']}"}
        prefix = f"{_PREFIX}{murmur_hash(fields['name']):08x}"[: len(_PREFIX) + 7]
        out.update({f"{prefix}/{field}": text for field, text in fields.items()})
    return out


def murmur_hash(text):
    """MurmurHash3_x86_32 with seed 0 of a text as UTF-8."""
    data, mask = text.encode(), 0xFFFFFFFF

    def turned(x, by):
        return (x << by | x >> (32 - by)) & mask

    def scrambled(k):
        return turned(k * 0xCC9E2D51 & mask, 15) * 0x1B873593 & mask

    whole, h = len(data) // 4 * 4, 0
    for (k,) in struct.iter_unpack("<I", data[:whole]):
        h = (turned(h ^ scrambled(k), 13) * 5 + 0xE6546B64) & mask
    h ^= scrambled(int.from_bytes(data[whole:], "little")) ^ len(data)
    h = (h ^ h >> 16) * 0x85EBCA6B & mask
    h = (h ^ h >> 13) * 0xC2B2AE35 & mask
    return h ^ h >> 16
