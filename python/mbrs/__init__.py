"""Vibration and motion of spatial multibody systems. ``import mbrs as mb``."""
