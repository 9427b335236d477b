"""What a session holds, as messages, and how it is read and written."""
