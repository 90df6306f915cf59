"""Figures as data, and their three forms: a static picture, what the page's script draws, and matplotlib's axes."""
