"""Three-vectors as tuples: as readable as arrays and some forty times faster in a kernel."""

from ..jit import inlined


@inlined
def dot(a, b):
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def add(a, b):
    """Sum."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inlined
def scale(factor, a):
    """Product with a number."""
    return (factor * a[0], factor * a[1], factor * a[2])


@inlined
def cross_xz(a, x, z):
    """Vector product a x (x, 0, z)."""
    return (a[1] * z, a[2] * x - a[0] * z, -a[1] * x)


@inlined
def y_cross(a):
    """e_y x a: the velocity of a point at a per unit angular velocity about y."""
    return (a[2], 0.0, -a[0])


@inlined
def times(matrix, a):
    """Product of a matrix, given by its three rows, with a vector."""
    return (dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a))
