"""Drive controllers without input or output: each is designed once, then takes one step a sample."""
