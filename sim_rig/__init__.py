"""The bench, pretended: robot, pendulum and camera that speak the same bytes as a real one."""
