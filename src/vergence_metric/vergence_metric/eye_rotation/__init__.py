"""The visual encoder: the eyes' true relative rotation from features that both see."""
