"""What moves the axis: whether a motor can do a motion."""
