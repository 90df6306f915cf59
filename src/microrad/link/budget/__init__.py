"""Budgets of the links, line by line, from the mission's tables; margin maps, and the largest rate or error."""
