"""One USB webcam to topics; two instances make the pair."""
