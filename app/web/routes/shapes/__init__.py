"""Responses of the API, as types.

The responses are built elsewhere and sent unchanged; these types describe them for OpenAPI and for authors of clients.
A test compares each type with real responses, key by key.
"""
