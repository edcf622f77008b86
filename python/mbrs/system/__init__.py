"""From a model to Tables, their compiled system, its state and its effects."""
