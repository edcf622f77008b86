"""Motion in time: simulation, trajectories, derivatives of the steps, blades in moving air."""
