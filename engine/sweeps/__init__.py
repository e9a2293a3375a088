"""Many designs of one car, side by side."""
