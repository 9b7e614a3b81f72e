"""The visual encoder: the eyes' relative rotation from features matched between them."""
