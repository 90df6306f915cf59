"""What rows say together: quantiles, shares and tails with their intervals, sensitivities, and a summary of all."""
