"""What stands behind the notebooks of the published tables and figures: one item a file of `assets/results/`."""
