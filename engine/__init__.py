"""Simulation and identification of the ride model; knows nothing of the web."""
