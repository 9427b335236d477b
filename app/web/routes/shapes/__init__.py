"""What the API answers, as types.

Answers are made elsewhere and sent as they are; these say what is in them, to OpenAPI and to who writes a client. A
test holds each against real answers, key by key.
"""
