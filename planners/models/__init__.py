"""What the planner believes about the load: linear states for planning, nonlinear rates for replay."""
