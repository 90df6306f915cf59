"""Studies, campaigns and identifications as processes of their own, and what they leave on disk."""
