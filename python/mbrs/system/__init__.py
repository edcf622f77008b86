"""The compiled system of a model, a snapshot of both, its state and its effects."""
