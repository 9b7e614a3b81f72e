"""Synchronised pairs to vergence metrics, signed disparity and the class-free tracker."""
