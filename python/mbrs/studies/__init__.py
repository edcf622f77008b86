"""Studies of accuracy, of effects and of derivatives."""
