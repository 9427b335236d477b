"""Live sensors: devices read as they deliver, synchronised into ticks."""
