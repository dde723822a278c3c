"""How fast fishbone is beside what one would use instead of it: `make bench`."""
