"""Measurement files as runs: read once, summed up, shown, lent to the processes that simulate."""
