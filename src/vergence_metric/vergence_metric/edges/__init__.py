"""Metric I: edges, their distances, chance level and contrast."""
