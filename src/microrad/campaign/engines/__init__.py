"""What runs the jobs of a campaign: threads of a worker process on this machine, or the workers of a cluster."""
