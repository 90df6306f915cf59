"""A whole study: the verdict in words and as data, the chain as a picture, and the page."""
