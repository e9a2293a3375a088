"""Recordings in the files of other programs, each read as a table of columns."""
