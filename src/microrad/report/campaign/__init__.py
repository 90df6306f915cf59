"""A campaign: its numbers, tables and sentences, the optimum, its figures and its page."""
