"""Studies of results: accuracy and cost, effects, derivatives by differences, the reference beside the core, what is installed."""
