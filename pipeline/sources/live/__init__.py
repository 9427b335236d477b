"""Live sensors: devices read as they deliver data, synchronised into ticks."""
