"""What edge_metric_node measures on one pair."""
