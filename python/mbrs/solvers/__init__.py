"""Solvers of equations that are not a model."""
