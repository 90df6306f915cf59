"""The local web page: a mission is designed by moving things; each page parses and renders, the work is done below."""
