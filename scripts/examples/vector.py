"""Three-component vectors as tuples, and the few quaternions that node transforms need (x, y, z, w)."""

import math


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a, factor):
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def normalize(a):
    """The unit vector along `a`, which must not be zero."""
    return scale(a, 1.0 / math.sqrt(dot(a, a)))


def mix(a, b, t):
    """Linear interpolation of two tuples of equal length."""
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def smoothstep(edge0, edge1, x):
    """0 below edge0, 1 above edge1, a cubic between."""
    t = min(max((x - edge0) / (edge1 - edge0), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def axis_angle(axis, degrees):
    """Quaternion of a counter-clockwise turn about a unit axis."""
    half = math.radians(degrees) / 2.0
    s = math.sin(half)
    return (axis[0] * s, axis[1] * s, axis[2] * s, math.cos(half))


def quaternion_multiply(a, b):
    """The rotation that applies b first, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def look_at(eye, target, up=(0.0, 1.0, 0.0)):
    """Quaternion that turns −Z towards the target and +Y towards `up`: a camera's or a light's.

    `up` must not be parallel to the direction of view.
    """
    z = normalize(subtract(eye, target))
    x = normalize(cross(up, z))
    y = cross(z, x)
    # Shepperd's method: divide by the largest of the four components.
    trace = x[0] + y[1] + z[2]
    choices = (trace, x[0], y[1], z[2])
    largest = choices.index(max(choices))
    if largest == 0:
        q = (y[2] - z[1], z[0] - x[2], x[1] - y[0], 1.0 + trace)
    elif largest == 1:
        q = (1.0 + x[0] - y[1] - z[2], x[1] + y[0], z[0] + x[2], y[2] - z[1])
    elif largest == 2:
        q = (x[1] + y[0], 1.0 + y[1] - z[2] - x[0], y[2] + z[1], z[0] - x[2])
    else:
        q = (z[0] + x[2], y[2] + z[1], 1.0 + z[2] - x[0] - y[1], x[1] - y[0])
    length = math.sqrt(sum(component * component for component in q))
    return tuple(component / length for component in q)
