"""The linear part of a mirror from recordings: frequency response, order, poles and their standard errors."""
