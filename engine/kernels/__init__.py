"""Compiled equations of motion, written once for any number of cars."""
