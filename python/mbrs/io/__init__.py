"""Files: of results, and of models and matrices in the formats of other programs, one format in a module."""
