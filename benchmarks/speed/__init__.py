"""Times of fishbone and of its alternatives: `make bench`."""
