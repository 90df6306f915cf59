"""Many models of the same recordings, judged on samples that none has seen, the best one, and its warnings."""
