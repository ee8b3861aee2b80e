"""Numbers in, plans out: trajectories, models and planners; pure, imports nothing else of this project."""
