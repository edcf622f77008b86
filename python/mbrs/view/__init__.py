"""Scenes that move, on self-contained pages."""
