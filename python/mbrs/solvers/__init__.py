"""Equations that are not a model: roots, derivatives of matrices by matrices."""
