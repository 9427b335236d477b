"""The content of a session as messages, with its reader and writer."""
