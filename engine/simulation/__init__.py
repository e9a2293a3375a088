"""Drives cars along recorded rims, over roads and on posts."""
