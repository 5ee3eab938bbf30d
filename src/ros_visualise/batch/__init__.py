"""Many recordings: found, run in processes of their own, and asked about afterwards."""
