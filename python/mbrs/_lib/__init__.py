"""Checks of arguments, text, files, progress, the border to the core: what every part of the package uses."""
