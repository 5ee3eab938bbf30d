"""The methods that lessons explain, in plain NumPy: slower than OpenCV, and open to look into."""
