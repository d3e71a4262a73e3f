"""Real-time estimators of the contour error."""
