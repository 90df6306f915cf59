"""An identification: sentences, parameters, data, figures and its page."""
