"""Camera calibration with boards: find the board, select views, fit, and validate."""
