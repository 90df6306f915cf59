"""The links: their budgets as text, data and CSV, their figures, and their page."""
