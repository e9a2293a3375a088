"""Folders of data that come with the installed package: the page and the sample runs."""

from importlib import import_module
from pathlib import Path

PACKAGE = __name__.removesuffix(".app.package_files")


def package_folder(name: str) -> Path:
    """Where a folder of data lies, in a checkout as in an installed wheel."""
    return Path(next(iter(import_module(f"{PACKAGE}.{name}").__path__)))
