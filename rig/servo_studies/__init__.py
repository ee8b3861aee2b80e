"""What the published comparisons of drive controllers amount to: numbers and figures, no printing."""
