"""The methods of the lessons in plain NumPy: slower than OpenCV, but easy to read."""
