"""Files: those that a user names, images, files in a store, files replaced as a whole, signatures."""
