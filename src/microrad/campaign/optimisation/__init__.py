"""The cheapest design that keeps the limits in a wanted share of the rows: candidates, and the search for the best."""
