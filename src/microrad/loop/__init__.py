"""Controllers, disturbances, and the pointing error that is left: linear, in ensembles, and of the paper's cases."""
