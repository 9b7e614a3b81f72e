"""Finding a servo's calibration: by hand in a terminal, or by what the cameras see."""
