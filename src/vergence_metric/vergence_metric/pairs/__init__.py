"""Two streams of images to synchronised pairs."""
