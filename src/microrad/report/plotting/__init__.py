"""Figures as data, and their two forms: a static picture, and what the page's script draws."""
