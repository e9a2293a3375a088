"""Height and slope of the road under a wheel."""

from ..jit import inlined


@inlined
def road_under(coefficients, start, per_metre, X):
    """Height (m) and slope of one side's piecewise cubic at X, held level outside its ends.

    coefficients : (cells, 4), z = ((c0 s + c1) s + c2) s + c3 with s in [0, 1) along the cell
    per_metre : cells in a metre
    """
    cells = coefficients.shape[0]
    position = (X - start) * per_metre
    if not position > 0.0:  # also where X is not a number
        return coefficients[0, 3], 0.0
    if position >= cells:
        c = coefficients[cells - 1]
        return c[0] + c[1] + c[2] + c[3], 0.0
    cell = int(position)
    s = position - cell
    c0, c1 = coefficients[cell, 0], coefficients[cell, 1]
    c2, c3 = coefficients[cell, 2], coefficients[cell, 3]
    height = ((c0 * s + c1) * s + c2) * s + c3
    slope = ((3.0 * c0 * s + 2.0 * c1) * s + c2) * per_metre
    return height, slope
