"""The class-free tracker."""
