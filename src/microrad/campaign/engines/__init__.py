"""What runs the jobs of a campaign: worker processes on this machine, or the workers of a cluster."""
