"""Steps that the road and posts modes accept, s; importing them brings nothing else."""

SHORTEST_STEP, LONGEST_STEP = 1e-5, 0.02
"""Of the integration: below, rounding and patience suffer; above, wheel hop does."""

LONGEST_SAMPLE_STEP = 1.0
"""Of the result; the shortest is that of the integration."""
