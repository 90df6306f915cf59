"""One mission to one verdict: the story, the paper's claims, other readings, what pointing costs, a contact in time."""
