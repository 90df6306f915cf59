"""Export: flight code, co-simulation units and matrices of a design; import of linear models."""
