"""What the log says: pure functions of numpy arrays, stamps in, numbers with their uncertainty out."""
