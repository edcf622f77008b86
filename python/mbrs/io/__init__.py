"""Files: of results, and of models in the formats of other programs."""
