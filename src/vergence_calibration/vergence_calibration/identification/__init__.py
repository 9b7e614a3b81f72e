"""Identifying a running head: latencies, pixels per radian and signs of every axis, from a few small moves."""
