"""What is open, played: a recording by its clock and by seeking, live sensors as they deliver."""
