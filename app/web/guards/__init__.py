"""Who may use the server, for what and how much: access rules, tokens, accounts, limits, the audit log."""
