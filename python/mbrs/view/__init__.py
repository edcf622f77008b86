"""Scenes that move, on self-contained pages. They see results only."""
