"""Optimisation of a design."""
