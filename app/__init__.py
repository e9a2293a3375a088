"""The service, the 3D scene, the background jobs and the command line."""

import os

# The matrices here are small or tall and thin: BLAS's own threads spin for longer than they work
# and take the cores from the simulations, whose threads are ours.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
