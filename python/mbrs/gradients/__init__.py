"""Gradients of motions."""
