"""Orbits that give a state for each time: by a formula, by SGP4 from mean elements, by a table of state vectors."""
