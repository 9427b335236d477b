"""One module for each kind of device, and what they share: reading in a thread, reconnecting, datagrams."""
