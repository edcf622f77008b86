"""Gradients of motions: objectives, direct and adjoint, their result."""
