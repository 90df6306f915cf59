"""Many models of the same recordings, judged on samples that none has seen, and the best one as a mirror file."""
