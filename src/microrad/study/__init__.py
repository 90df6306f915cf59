"""One mission to one verdict: the whole study, the paper's claims, other readings, what pointing costs, one contact."""
