"""Slow independent models the engine is held against."""
